"""A wheel, looked at from outside: what is in it, which glibc it needs, and whether other machines than this could load it.

`cargo xtask python --wheels` runs this on each. What does not hold ends it with an error.
"""

from __future__ import annotations

import argparse
import io
import pathlib
import re
import zipfile

from auditwheel.architecture import Architecture
from auditwheel.libc import Libc
from auditwheel.policy import WheelPolicies
from elftools.elf.dynamic import DynamicSection
from elftools.elf.elffile import ELFFile
from elftools.elf.gnuversions import GNUVerNeedSection

GLIBC = (2, 17)
"""Of manylinux2014."""
MACHINES = {"x86_64": "EM_X86_64", "aarch64": "EM_AARCH64"}
MODULE = "muslip/_native.abi3.so"


def needed(elf: ELFFile) -> tuple[list[str], dict[str, list[str]]]:
    """The libraries that a module needs, and the versions of their symbols."""
    libraries: list[str] = []
    versions: dict[str, list[str]] = {}
    for section in elf.iter_sections():
        if isinstance(section, DynamicSection):
            libraries += [tag.needed for tag in section.iter_tags() if tag.entry.d_tag == "DT_NEEDED"]
        if isinstance(section, GNUVerNeedSection):
            for library, symbols in section.iter_versions():
                versions[library.name] = [symbol.name for symbol in symbols]
    return libraries, versions


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheel", type=pathlib.Path)
    parser.add_argument("--machine", choices=MACHINES, required=True)
    given = parser.parse_args()
    tags = given.wheel.name.removesuffix(".whl").split("-")[2:]
    assert tags[:2] == ["cp310", "abi3"] and f"manylinux2014_{given.machine}" in tags[2].split("."), tags
    with zipfile.ZipFile(given.wheel) as wheel:
        names = wheel.namelist()
        for name in (MODULE, "muslip/py.typed", "muslip/_native.pyi", "muslip/__init__.py", "muslip/fleet/__main__.py"):
            assert name in names, f"{name} is not among {names}"
        assert not [name for name in names if "/tests/" in name or name.endswith(".pyc")]
        content = wheel.read(MODULE)
    elf = ELFFile(io.BytesIO(content))
    assert elf["e_machine"] == MACHINES[given.machine], elf["e_machine"]
    libraries, versions = needed(elf)
    policies = WheelPolicies(libc=Libc.GLIBC, arch=Architecture(given.machine))
    allowed = policies.get_policy_by_name(f"manylinux_{GLIBC[0]}_{GLIBC[1]}_{given.machine}")
    # The loader is every machine's own.
    foreign = [name for name in libraries if name not in allowed.whitelist and not name.startswith("ld-linux")]
    assert not foreign, f"needs {foreign}, which a machine of manylinux2014 may not have"
    glibc = [
        tuple(map(int, found.group(1).split(".")))
        for of in versions.values()
        for version in of
        if (found := re.fullmatch(r"GLIBC_([\d.]+)", version))
    ]
    assert glibc and max(glibc) <= GLIBC, f"needs glibc {max(glibc)}"
    newest = ".".join(map(str, max(glibc)))
    size = given.wheel.stat().st_size / 2**20
    print(f"{given.wheel.name}: {size:.1f} MB, needs {', '.join(sorted(libraries))}, glibc {newest}")


if __name__ == "__main__":
    main()
