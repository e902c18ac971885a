"""Writes files of every format with the tools that the field uses, and beside each what is in it.

write.py FOLDER: FOLDER/NAME with FOLDER/NAME.json, which lists channels with their values, times and invalid readings. The tests of the readers
(tests/readers.rs) hold what they read against it. `cargo xtask formats` makes the environment (requirements.txt) and calls this.
"""

import json
import pathlib
import struct
import sys

import numpy as np

OUT = pathlib.Path(sys.argv[1])
RNG = np.random.default_rng(20404)


def expect(name, channels, faults=False, refused=None):
    """Notes what a file holds. A channel: (group, name, values, times or None, unit, places of invalid readings)."""
    listed = []
    for group, channel, values, times, unit, invalid in channels:
        numbers = [None if v is None or not np.isfinite(v) else float(v) for v in np.asarray(values, dtype=object).tolist()]
        listed.append({
            "group": group, "name": channel, "values": numbers, "unit": unit, "invalid": sorted(int(k) for k in invalid),
            "times": None if times is None else [float(t) for t in times],
        })
    text = json.dumps({"channels": listed, "faults": faults, "refused": refused})
    (OUT / (name + ".json")).write_text(text)


def mdf():
    from asammdf import MDF, Signal
    from asammdf.blocks.conversion_utils import from_dict

    t200 = np.arange(2000) / 200.0
    t50 = np.arange(500) / 50.0 + 0.003
    t10 = np.arange(101) / 10.0
    # More than one block of 4 MB when packed.
    tbig = np.arange(700_000) / 10_000.0
    kinds = [np.uint8, np.int8, np.uint16, np.int16, np.uint32, np.int32, np.uint64, np.int64, np.float32, np.float64]

    def signals(version):
        speed = Signal(50 + RNG.normal(size=2000), t200, unit="km/h", name="vVeh", comment="vehicle speed")
        wheel = Signal((RNG.normal(size=500) * 1000).astype(np.int16), t50, unit="1/min", name="nWheelFL",
                       conversion={"a": 0.125, "b": -3.5})
        ints = [Signal((np.arange(101) % 100).astype(kind), t10, unit="N", name=f"k_{np.dtype(kind).name}") for kind in kinds]
        return speed, wheel, ints

    for version in ["3.00", "3.20", "3.30", "4.00", "4.10", "4.11", "4.20"]:
        # From 3 on zstd and LZ4, each plain and transposed.
        for compression in ([0, 1, 2, 3, 4, 5, 6] if version == "4.20" else [0, 1, 2] if version >= "4.10" else [0]):
            speed, wheel, ints = signals(version)
            file = MDF(version=version)
            file.append([speed], comment="fast")
            file.append([wheel])
            file.append(ints)
            extra = []
            if version >= "4":
                flags = RNG.random(101) < 0.1
                bad = Signal(np.arange(101.0), t10, unit="bar", name="pBrake", invalidation_bits=flags)
                file.append([bad])
                extra.append(("3", "pBrake", bad.samples, t10, "bar", np.nonzero(flags)[0]))
                texts = Signal(np.array([b"on", b"off", b"on"] * 30 + [b"x"] * 11), t10, name="text", encoding="utf-8")
                file.append([texts])
                table = Signal(np.arange(101).astype(np.uint8), t10, name="tab", unit="N",
                               conversion=from_dict({f"raw_{k}": v for k, v in enumerate([0.0, 10.0, 50.0, 100.0])}
                                                    | {f"phys_{k}": v for k, v in enumerate([1.0, 2.0, 40.0, 45.0])}
                                                    | {"interpolation": True}))
                rational = Signal(np.arange(101.0), t10, name="rat", unit="N",
                                  conversion=from_dict({"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.0, "P5": 0.0, "P6": 4.0}))
                words = Signal((np.arange(101) % 3).astype(np.uint8), t10, name="gear",
                               conversion=from_dict({"val_0": 0, "val_1": 1, "val_2": 2, "text_0": "P", "text_1": "R", "text_2": "N", "default": b"?"}))
                file.append([table, rational, words])
                expected = np.interp(np.arange(101), [0, 10, 50, 100], [1, 2, 40, 45])
                extra.append(("5", "tab", expected, t10, "N", []))
                extra.append(("5", "rat", (2 * np.arange(101.0) + 1) / 4, t10, "N", []))
                extra.append(("5", "gear", np.arange(101) % 3, t10, "", []))
                if version == "4.11":
                    big = Signal(RNG.normal(size=len(tbig)), tbig, unit="N", name="big")
                    file.append([big])
                    # Its numbers stand in one list alone: they are many.
                    extra.append(("6", "big", big.samples, tbig, "N", []) if compression == 2 else None)
            name = f"asammdf-{version}-{compression}.mf4" if version >= "4" else f"asammdf-{version}.mdf"
            file.save(OUT / name, overwrite=True, compression=compression)
            file.close()
            channels = [
                ("0", "vVeh", speed.samples, t200, "km/h", []),
                ("1", "nWheelFL", 0.125 * wheel.samples - 3.5, t50, "1/min", []),
            ] + [("2", s.name, s.samples, t10, "N", []) for s in ints] + [c for c in extra if c]
            expect(name, channels)


def unsorted_mdf():
    """Records of two groups mixed, in blocks that cut through them; no third-party writer makes these."""
    def block(kind, links, data):
        length = 24 + 8 * len(links) + len(data)
        return kind + b"\0" * 4 + struct.pack("<QQ", length, len(links)) + b"".join(struct.pack("<Q", link) for link in links) + data

    a = RNG.normal(size=3000)
    b = (RNG.normal(size=1500) * 1e4).astype(np.int32)
    stream = b""
    for k in range(3000):
        stream += b"\1" + struct.pack("<dd", k * 0.001, a[k])
        if k % 2 == 0:
            stream += b"\2" + struct.pack("<di", k * 0.001, b[k // 2])

    def build(version, cut=0, alone=False):
        out = bytearray(64)
        places = {}

        def put(name, content):
            while len(out) % 8:
                out.append(0)
            places[name] = len(out)
            out.extend(content)
            return places[name]

        number = int(version.replace(".", ""))
        out[:64] = (b"MDF     " + (version + "    ").encode()[:8] + b"muslip  " + b"\0" * 4 + struct.pack("<H", number) + b"\0" * 34)[:64]
        head = put("HD", block(b"##HD", [0] * 6, struct.pack("<QhhBBBBdd", 10**18, 60, 0, 2, 0, 0, 0, 0, 0)))

        def text(what):
            data = what.encode() + b"\0"
            return put(what, block(b"##TX", [], data + b"\0" * (-len(data) % 8)))

        def channel(name, kind, sync, data, offset, bits, unit, following):
            links = [following, 0, text(name), 0, 0, 0, text(unit), 0]
            body = struct.pack("<BBBBIIIIBBHdddddd", kind, sync, data, 0, offset, bits, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
            return put("CN" + name, block(b"##CN", links, body))

        def group(number, count, size, first, following):
            body = struct.pack("<QQHHIII", number, count, 0, 0, 0, size, 0)
            return put(f"CG{number}", block(b"##CG", [following, first, 0, 0, 0, 0], body))

        y = channel("y", 0, 0, 2, 8, 32, "N", 0)
        t2 = channel("t2", 2, 1, 4, 0, 64, "s", y)
        x = channel("x", 0, 0, 4, 8, 64, "km/h", 0)
        t1 = channel("t1", 2, 1, 4, 0, 64, "s", x)
        second = group(2, 1500, 12, t2, 0)
        first = group(1, 3000, 16, t1, 0 if alone else second)
        if alone:
            dg = put("DG", block(b"##DG", [0, first, 0, 0], struct.pack("<B7x", 0)))
            records = b"".join(struct.pack("<dd", k * 0.001, a[k]) for k in range(3000))
            at = put("DT", block(b"##DT", [], records))
            struct.pack_into("<Q", out, dg + 24 + 16, at)
            struct.pack_into("<Q", out, head + 24, dg)
            return bytes(out)
        dg = put("DG", block(b"##DG", [0, first, 0, 0], struct.pack("<B7x", 1)))
        pieces = [stream[k:k + 1000] for k in range(0, len(stream), 1000)]
        list_at = put("DL", block(b"##DL", [0] * (1 + len(pieces)), struct.pack("<BxxxI", 1, len(pieces)) + struct.pack("<Q", 1000)))
        for k, piece in enumerate(pieces):
            at = put(f"DT{k}", block(b"##DT", [], piece))
            struct.pack_into("<Q", out, list_at + 24 + 8 * (1 + k), at)
        struct.pack_into("<Q", out, dg + 24 + 16, list_at)
        struct.pack_into("<Q", out, head + 24, dg)
        return bytes(out[:len(out) - cut] if cut else out)

    times = np.arange(3000) * 0.001
    for version in ["4.10", "4.30"]:
        name = f"unsorted-{version}.mf4"
        (OUT / name).write_bytes(build(version))
        expect(name, [("0", "x", a, times, "km/h", []), ("1", "y", b, times[::2], "N", [])], faults=version == "4.30")
    # A sorted file with its records last, as recorders write it, cut off within them.
    sorted_file = build("4.10", alone=True)
    (OUT / "sorted.mf4").write_bytes(sorted_file)
    expect("sorted.mf4", [("0", "x", a, times, "km/h", [])])
    (OUT / "sorted-cut.mf4").write_bytes(sorted_file[:-16 * 1000 - 5])
    expect("sorted-cut.mf4", [("0", "x", a[:1999], times[:1999], "km/h", [])], faults=True)
    cut = 1024 * 20
    (OUT / "unsorted-cut.mf4").write_bytes(build("4.10", cut))
    # What is left before the cut: as many whole records as the whole blocks and the rest of the cut one hold.
    expect("unsorted-cut.mf4", [], faults=True)


def tdms():
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter

    name = "nptdms.tdms"
    kinds = [np.int8, np.int16, np.int32, np.int64, np.uint8, np.uint16, np.uint32, np.uint64, np.float32, np.float64]
    with TdmsWriter(OUT / name) as writer:
        parts = {}
        for part in range(3):
            objects = [RootObject(properties={"title": "x"}), GroupObject("A", properties={"rig": 1})]
            for kind in kinds:
                values = (RNG.normal(size=100 + part) * 50).astype(kind)
                parts.setdefault(np.dtype(kind).name, []).append(values)
                objects.append(ChannelObject("A", np.dtype(kind).name, values,
                                             properties={"unit_string": "kN", "wf_increment": 0.01, "wf_start_offset": 0.5}))
            writer.write_segment(objects)
    times = 0.5 + np.arange(303) * 0.01
    expect(name, [("A", n, np.concatenate(v), times, "kN", []) for n, v in parts.items()])

    name = "nptdms-scaled.tdms"
    raw = np.arange(-50, 50, dtype=np.int16)
    with TdmsWriter(OUT / name) as writer:
        properties = {"NI_Number_Of_Scales": 2, "NI_Scaling_Status": "unscaled",
                      "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": 2.0, "NI_Scale[0]_Linear_Y_Intercept": 10.0,
                      "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
                      "NI_Scale[1]_Scale_Type": "Polynomial", "NI_Scale[1]_Polynomial_Coefficients_Size": 3,
                      "NI_Scale[1]_Polynomial_Coefficients[0]": 1.0, "NI_Scale[1]_Polynomial_Coefficients[1]": 0.5,
                      "NI_Scale[1]_Polynomial_Coefficients[2]": -0.25, "NI_Scale[1]_Polynomial_Input_Source": 0}
        writer.write_segment([ChannelObject("g", "it's", raw, properties=properties)])
    linear = 2.0 * raw + 10
    expect(name, [("g", "it's", 1 + 0.5 * linear - 0.25 * linear**2, None, "", [])])

    sensors()

    # The generators of npTDMS's own tests; what it makes of them is what must be read.
    from nptdms.test import scenarios
    for parameter in scenarios.get_scenarios():
        generated, wanted = parameter.values
        name = f"scenario-{parameter.id}.tdms"
        (OUT / name).write_bytes(generated._get_contents())
        channels = []
        with TdmsFile.read(OUT / name) as file:
            for group in file.groups():
                for channel in group.channels():
                    values = np.asarray(channel[:])
                    if values.dtype.kind in "iufb" and len(values):
                        channels.append((group.name, channel.name, values, None, "", []))
        expect(name, channels, faults=None)
    daqmx()


def sensors():
    """Scales of sensors: what npTDMS makes of them, and for cold resistance thermometers the temperature that the voltage was computed from."""
    from nptdms import ChannelObject, TdmsFile, TdmsWriter

    def scale(kind, values, **properties):
        every = {"Number_Of_Scales": 1, "Scaling_Status": "unscaled", "Scale[0]_Scale_Type": kind, f"Scale[0]_{kind}_Input_Source": 0xFFFFFFFF}
        every |= {f"Scale[0]_{kind}_{key}": value for key, value in properties.items()}
        return values, {f"NI_{key}": value for key, value in every.items()}

    channels, exact = {}, {}
    # Near 0 °C a difference of nearly equal numbers leaves fewer digits than are held against.
    celsius = np.concatenate([np.linspace(-190.0, -5.0, 200), np.linspace(5.0, 600.0, 200)])
    a, b, c = 3.9083e-3, -5.775e-7, -4.183e-12
    ohm = 100.0 * (1 + a * celsius + b * celsius**2 + np.where(celsius < 0, c * (celsius - 100) * celsius**3, 0.0))
    for wires in [2, 3, 4]:
        name = f"rtd {wires}"
        volt = 1e-3 * (ohm + {2: 2 * 0.25, 3: 0.25, 4: 0.0}[wires])
        channels[name] = scale("RTD", volt, Current_Excitation=1e-3, R0_Nominal_Resistance=100.0, A=a, B=b, C=c,
                               Lead_Wire_Resistance=0.25, Resistance_Configuration=wires)
        exact[name] = celsius
        for excitation, value in [(10134, 1e-4), (10322, 5.0)]:
            volt = np.linspace(0.05, 2.0, 200)
            channels[f"thermistor {wires} {excitation}"] = scale(
                "Thermistor", volt, Excitation_Type=excitation, Excitation_Value=value, Resistance_Configuration=wires, R1_Reference_Resistance=5000.0,
                Lead_Wire_Resistance=2.0, A=1.2873851e-3, B=2.3575235e-4, C=9.4978060e-8, Temperature_Offset=273.15)
    for configuration in [10183, 10184, 10185, 10188, 10189, 10271, 10272]:
        channels[f"strain {configuration}"] = scale(
            "Strain", np.linspace(-0.02, 0.02, 201), Configuration=configuration, Poisson_Ratio=0.3, Gage_Resistance=350.0, Lead_Wire_Resistance=1.5,
            Initial_Bridge_Voltage=1e-4, Gage_Factor=2.1, Bridge_Shunt_Calibration_Gain_Adjustment=1.01, Voltage_Excitation=2.5)
    for kind in [10047, 10055, 10072, 10073, 10077, 10082, 10085, 10086]:
        for direction, values in [(0, np.linspace(-6000.0, 70000.0, 500)), (1, np.linspace(-260.0, 1800.0, 500))]:
            channels[f"thermocouple {kind} {direction}"] = scale("Thermocouple", values, Thermocouple_Type=kind, Scaling_Direction=direction)
    name = "nptdms-sensors.tdms"
    with TdmsWriter(OUT / name) as writer:
        writer.write_segment([ChannelObject("sensors", key, values, properties=properties) for key, (values, properties) in channels.items()])
    wanted = []
    with TdmsFile.read(OUT / name) as file:
        for key in channels:
            values = file["sensors"][key][:]
            if key in exact:
                # npTDMS finds the roots of a polynomial there, with less accuracy than its inverse has.
                assert np.allclose(values, exact[key], rtol=1e-9, atol=1e-9), key
                values = exact[key]
            wanted.append(("sensors", key, values, None, "", []))
    expect(name, wanted)

    name = "nptdms-unknown-scale.tdms"
    with TdmsWriter(OUT / name) as writer:
        writer.write_segment([ChannelObject("g", key, np.arange(5.0), properties=scale(kind, None, Configuration=1, Excitation_Type=1)[1])
                              for key, kind in [("odd", "Reciprocal"), ("bridge", "Strain"), ("divider", "Thermistor")]])
    expect(name, [], refused=["odd", "bridge", "divider"])


def daqmx():
    """What npTDMS's tests of DAQmx write: their calls of `add_segment` are caught."""
    import nptdms.test.test_daqmx as tests
    from nptdms import TdmsFile
    from nptdms.test import util

    made = []

    class Caught(util.GeneratedFile):
        def __init__(self):
            super().__init__()
            made.append(self)

    tests.GeneratedFile = Caught
    for test in [name for name in dir(tests) if name.startswith("test_")]:
        made.clear()
        try:
            getattr(tests, test)()
        except Exception:
            # Tests with parameters, or that expect an error.
            pass
        for number, generated in enumerate(made):
            name = f"daqmx-{test}-{number}.tdms"
            (OUT / name).write_bytes(generated._get_contents())
            channels = []
            try:
                with TdmsFile.read(OUT / name) as file:
                    for group in file.groups():
                        for channel in group.channels():
                            values = np.asarray(channel[:])
                            if values.dtype.kind in "iufb" and len(values):
                                channels.append((group.name, channel.name, values, None, "", []))
            except Exception:
                (OUT / name).unlink()
                continue
            expect(name, channels, faults=None)


def mat():
    import scipy
    from scipy.io import loadmat, savemat
    from scipy.sparse import csc_matrix

    kinds = ["int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64"]
    for version, packed in [("4", False), ("5", False), ("5", True)]:
        content = {f"v_{k}": (RNG.normal(size=200) * 50).astype(k) for k in (kinds if version == "5" else ["float64", "int32", "uint8"])}
        content["tall"] = RNG.normal(size=(100, 3))
        content["row"] = RNG.normal(size=(1, 50))
        content["label"] = "text"
        channels = [("", k, v.ravel(), None, "", []) for k, v in content.items() if k.startswith("v_") or k == "row"]
        channels += [("", f"tall(:,{k + 1})", content["tall"][:, k], None, "", []) for k in range(3)]
        if version == "5":
            content["flag"] = RNG.random(40) > 0.5
            content["rig"] = {"speed": RNG.normal(size=30), "inner": {"load": np.arange(30.0)}}
            content["sparse"] = csc_matrix(np.eye(3))
            content["cell"] = np.array(["a", 1.0], dtype=object)
            channels += [("", "flag", content["flag"], None, "", []), ("rig", "speed", content["rig"]["speed"], None, "", []),
                         ("rig.inner", "load", content["rig"]["inner"]["load"], None, "", [])]
        name = f"scipy-{version}{'-packed' if packed else ''}.mat"
        savemat(OUT / name, content, format=version, do_compression=packed, oned_as="column")
        expect(name, channels)

    # MATLAB's own files, as scipy ships them for its tests: vectors of real numbers at the top.
    for path in sorted((pathlib.Path(scipy.__file__).parent / "io/matlab/tests/data").glob("*.mat")):
        try:
            content = loadmat(path)
        except Exception:
            continue
        channels = []
        for key, value in content.items():
            if not key.startswith("__") and isinstance(value, np.ndarray) and value.dtype.kind in "iufb" and 1 in value.shape and value.size:
                channels.append(("", key, value.ravel(), None, "", []))
        name = f"matlab-{path.name}"
        (OUT / name).write_bytes(path.read_bytes())
        expect(name, channels, faults=None)


def matlab_table():
    """A table as MATLAB saves it in v7: an object of a class, in a form that scipy names but does not write."""
    import scipy.io

    def element(kind, content):
        return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)

    name = "table.mat"
    scipy.io.savemat(OUT / name, {"speed": np.arange(20.0)})
    flags = lambda code: element(6, struct.pack("<II", code, 0))
    inner = element(14, flags(13) + element(5, struct.pack("<ii", 1, 6)) + element(1, b"") + element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1)))
    opaque = element(14, flags(17) + element(1, b"readings") + element(1, b"MCOS") + element(1, b"table") + inner)
    with open(OUT / name, "ab") as file:
        file.write(opaque)
    assert [type(one).__name__ for one in scipy.io.loadmat(OUT / name).values()].count("MatlabOpaque") == 1
    expect(name, [("", "speed", np.arange(20.0), None, "", [])], refused=["readings"])


def hdf5():
    import h5py

    name = "h5py.h5"
    channels = []
    with h5py.File(OUT / name, "w") as file:
        for kind in ["<i2", ">i4", "<u8", "<f4", ">f8"]:
            values = (RNG.normal(size=500) * 100).astype(kind)
            for how, options in [("plain", {}), ("gzip", {"chunks": (64,), "compression": "gzip", "shuffle": True, "fletcher32": True}),
                                 ("chunks", {"chunks": (70,), "maxshape": (None,)})]:
                path = f"run/{how}/{np.dtype(kind).kind}{np.dtype(kind).itemsize}"
                data = file.create_dataset(path, data=values, **options)
                data.attrs["unit"] = "km/h"
                channels.append((f"run/{how}", path.rsplit("/", 1)[1], values, None, "km/h", []))
        table = np.zeros(20, dtype=[("t", "<f8"), ("f", "<f4"), ("s", "S4")])
        table["t"] = np.arange(20)
        table["f"] = RNG.normal(size=20)
        file["table"] = table
        channels += [("table", "t", table["t"], None, "", []), ("table", "f", table["f"], None, "", [])]
        tall = RNG.normal(size=(40, 2))
        file["tall"] = tall
        channels += [("", f"tall[:,{k}]", tall[:, k], None, "", []) for k in range(2)]
        file["flag"] = np.array([True, False] * 5)
        channels.append(("", "flag", np.array([1, 0] * 5), None, "", []))
        file["text"] = ["a", "b"]
    expect(name, channels)

    # As MATLAB writes v7.3: a user block, matrices turned, the class as an attribute.
    name = "v73.mat"
    channels = []
    with h5py.File(OUT / name, "w", userblock_size=512) as file:
        for key in ["speed", "load"]:
            values = RNG.normal(size=300)
            file.create_dataset(key, data=values.reshape(1, -1), compression="gzip", chunks=(1, 100)).attrs["MATLAB_class"] = np.bytes_("double")
            channels.append(("", key, values, None, "", []))
        values = RNG.normal(size=(300, 2))
        file.create_dataset("tall", data=values.T).attrs["MATLAB_class"] = np.bytes_("double")
        channels += [("", f"tall(:,{k + 1})", values[:, k], None, "", []) for k in range(2)]
    with open(OUT / name, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + struct.pack("<H", 0x0200) + b"IM")
    expect(name, channels)

    # LZF packs whole runs, little, and not at all; a chunk that does not shrink is left as it is.
    name = "h5py-lzf.h5"
    channels = []
    with h5py.File(OUT / name, "w") as file:
        for key, values in [("steps", np.arange(5000.0) // 700), ("ramp", np.arange(5000.0)), ("noise", RNG.normal(size=5000)),
                            ("counts", (RNG.normal(size=5000) * 3).astype("<i2")), ("same", np.zeros(5000, "<f4"))]:
            for shuffle in [False, True]:
                path = f"{key}{int(shuffle)}"
                file.create_dataset(path, data=values, compression="lzf", shuffle=shuffle, chunks=(1100,))
                channels.append(("", path, values, None, "", []))
    expect(name, channels)

    # A filter that is not there: the number of one that is registered by others, marked as optional so that h5py writes without it.
    name = "filter.h5"
    with h5py.File(OUT / name, "w") as file:
        kind = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        kind.set_chunk((100,))
        kind.set_shuffle()
        file["y"] = np.arange(10.0)
        h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((1000,)), dcpl=kind).write(
            h5py.h5s.ALL, h5py.h5s.ALL, np.arange(1000.0))
    whole = (OUT / name).read_bytes()
    # The filter's number in the header of the data set, in place of the one of shuffle.
    at = whole.index(b"shuffle\0") - 8
    assert whole[at:at + 2] == b"\x02\x00"
    (OUT / name).write_bytes(whole[:at] + struct.pack("<H", 32015) + whole[at + 2:])
    expect(name, [("", "y", np.arange(10.0), None, "", [])], refused=["x"])

    # As MATLAB writes a table in v7.3: a reference to its parts, and the class as an attribute.
    name = "v73-table.mat"
    with h5py.File(OUT / name, "w", userblock_size=512) as file:
        for kind in ["table", "timetable", "string"]:
            data = file.create_dataset(kind, data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype="<u4"))
            data.attrs["MATLAB_class"] = np.bytes_(kind)
            data.attrs["MATLAB_object_decode"] = np.int32(3)
        file.create_dataset("speed", data=np.arange(50.0).reshape(1, -1)).attrs["MATLAB_class"] = np.bytes_("double")
    with open(OUT / name, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + struct.pack("<H", 0x0200) + b"IM")
    expect(name, [("", "speed", np.arange(50.0), None, "", [])], refused=["table", "timetable", "string"])


def arrow():
    import pandas as pd
    import pyarrow as pa
    import pyarrow.feather as feather
    import pyarrow.parquet as pq

    count = 700
    stamps = pd.date_range("2026-03-04T09:15:00.25Z", periods=count, freq="5ms")
    missing = RNG.random(count) < 0.05
    values = RNG.normal(size=count)
    ints = (RNG.normal(size=count) * 100).astype(np.int16)
    fields = [
        pa.field("when", pa.timestamp("ns", "UTC")), pa.field("speed", pa.float64(), metadata={"unit": "km/h"}), pa.field("count", pa.int16()),
        pa.field("single", pa.float32()), pa.field("big", pa.uint64()), pa.field("label", pa.string()), pa.field("ok", pa.bool_()),
        pa.field("load [kN]", pa.float64()),
    ]
    table = pa.Table.from_arrays([
        pa.array(stamps, pa.timestamp("ns", "UTC")), pa.array(values, mask=missing), pa.array(ints), pa.array(values.astype(np.float32)),
        pa.array(np.arange(count, dtype=np.uint64)), pa.array(["x"] * count), pa.array(ints > 0), pa.array(values * 2),
    ], schema=pa.schema(fields))
    speed = values.copy()
    speed[missing] = np.nan
    channels = [
        ("", "when", np.arange(count) * 0.005, None, "s", []), ("", "speed", speed, None, "km/h", np.nonzero(missing)[0]),
        ("", "count", ints, None, "", []), ("", "single", values.astype(np.float32), None, "", []), ("", "big", np.arange(count), None, "", []),
        ("", "ok", ints > 0, None, "", []), ("", "load", values * 2, None, "kN", []),
    ]
    for codec in ["none", "snappy", "gzip", "zstd", "lz4", "brotli"]:
        for version in ["1.0", "2.6"]:
            name = f"pyarrow-{codec}-{version}.parquet"
            times = {"coerce_timestamps": "us", "allow_truncated_timestamps": True} if version == "1.0" else {}
            pq.write_table(table, OUT / name, compression=codec, version=version, row_group_size=300,
                           data_page_version="2.0" if version == "2.6" else "1.0", **times)
            expect(name, channels)
    for codec in ["uncompressed", "lz4", "zstd"]:
        name = f"pyarrow-{codec}.feather"
        feather.write_feather(table, OUT / name, compression=codec, chunksize=300)
        expect(name, channels)
    frame = pd.DataFrame({"time": np.arange(100) / 10, "v": RNG.normal(size=100)})
    frame.to_parquet(OUT / "pandas.parquet")
    expect("pandas.parquet", [("", "time", frame["time"], None, "", []), ("", "v", frame["v"], None, "", [])])


def csv():
    import pandas as pd

    frame = pd.DataFrame({"Zeit [s]": np.arange(300) / 100, "Geschwindigkeit [km/h]": RNG.normal(size=300) * 50, "Längskraft [kN]": RNG.normal(size=300)})
    channels = [("", "Zeit", frame.iloc[:, 0], None, "s", []), ("", "Geschwindigkeit", frame.iloc[:, 1], None, "km/h", []),
                ("", "Längskraft", frame.iloc[:, 2], None, "kN", [])]
    for sep in [",", ";", "\t", "|"]:
        for decimal in [".", ","]:
            for encoding in ["utf-8", "utf-8-sig", "utf-16", "cp1252"]:
                if sep == decimal:
                    continue
                mark = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", ".": "point"}
                name = f"pandas-{mark[sep]}-{mark[decimal]}-{encoding}.csv"
                frame.to_csv(OUT / name, sep=sep, decimal=decimal, encoding=encoding, index=False)
                expect(name, channels)


def shipped():
    """Files that npTDMS (from loggers), h5py and pyarrow ship for their own tests, as they read them."""
    import h5py
    import nptdms
    import pyarrow as pa
    import pyarrow.parquet as pq

    for path in sorted((pathlib.Path(nptdms.__file__).parent / "test" / "data").glob("*.tdms")):
        channels = []
        with nptdms.TdmsFile.read(path) as file:
            for group in file.groups():
                for channel in group.channels():
                    values = np.asarray(channel[:])
                    if values.dtype.kind in "iufb" and len(values):
                        channels.append((group.name, channel.name, values, None, "", []))
        name = f"shipped-nptdms-{path.name}"
        (OUT / name).write_bytes(path.read_bytes())
        expect(name, channels, faults=None)
    for path in sorted((pathlib.Path(h5py.__file__).parent / "tests" / "data_files").glob("*.h5")):
        channels = []

        def one(key, data):
            if isinstance(data, h5py.Dataset) and data.ndim == 1 and data.dtype.kind in "iuf" and data.size:
                channels.append((key.rsplit("/", 1)[0] if "/" in key else "", key.rsplit("/", 1)[-1], data[:], None, "", []))

        with h5py.File(path, "r") as file:
            file.visititems(one)
        name = f"shipped-h5py-{path.name}"
        (OUT / name).write_bytes(path.read_bytes())
        expect(name, channels, faults=None)
    for path in sorted((pathlib.Path(pa.__file__).parent / "tests" / "data").rglob("*.parquet")):
        channels = []
        for key, column in zip((table := pq.read_table(path)).column_names, table.columns):
            if (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)) and not column.null_count and len(column):
                channels.append(("", key, column.to_numpy(), None, "", []))
        name = f"shipped-pyarrow-{path.name}"
        (OUT / name).write_bytes(path.read_bytes())
        expect(name, channels, faults=None)


if __name__ == "__main__":
    OUT.mkdir(parents=True, exist_ok=True)
    for step in [mdf, unsorted_mdf, tdms, mat, matlab_table, hdf5, arrow, csv, shipped]:
        step()
    print(f"{len(list(OUT.glob('*.json')))} files")
