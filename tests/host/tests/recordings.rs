//! Reading recordings: every complaint is one line that names the exact place, and nothing panics.

use std::fs;
use std::io::Write;
use std::path::Path;

use crate::common::{HEADER, RIG, Scratch};
use muslip_recordings::recording::{Channel, Recording, Required, Run};
use proptest::prelude::*;

fn read(contents: &[u8], required: Required) -> Result<Run, String> {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(contents).unwrap();
    Run::read(file.path(), required).map_err(|error| {
        error
            .to_string()
            .replace(file.path().to_str().unwrap(), "run.csv")
    })
}

fn complaint(contents: impl AsRef<[u8]>) -> String {
    read(contents.as_ref(), Required::DragIncluded).expect_err("must be refused")
}

#[test]
fn every_malformed_input_is_told_with_its_line_and_column() {
    let row = "0,60,20,100,4000";
    for (contents, expected) in [
        (
            String::new(),
            "run.csv:1:1: the file is empty: a header row is needed",
        ),
        (
            "# a comment\n\n".into(),
            "run.csv:1:1: the file is empty: a header row is needed",
        ),
        (
            format!("{HEADER}\n"),
            "run.csv:1:71: no rows below the header",
        ),
        (
            "time_s,wheel_speed_rad_s,vehicle_speed_m_s,normal_force_n\n0,1,2,3\n".into(),
            "run.csv:1:1: required column drag_force_n is missing",
        ),
        (
            format!("{HEADER},drag_force_n\n{row},1\n"),
            "run.csv:1:72: column \"drag_force_n\" appears twice",
        ),
        (
            format!("{HEADER},\n{row},1\n"),
            "run.csv:1:72: column 6 has no name in the header",
        ),
        (
            format!("{HEADER}\n{row}\n1,2,3\n"),
            "run.csv:3:6: 3 cells where the header has 5",
        ),
        (
            format!("{HEADER}\n{row},7\n"),
            "run.csv:2:18: 6 cells where the header has 5",
        ),
        (
            format!("{HEADER}\n0,60,abc,100,4000\n"),
            "run.csv:2:6: vehicle_speed_m_s: \"abc\" is not a number",
        ),
        (
            format!("{HEADER},note\n{row},wet\n"),
            "run.csv:2:18: note: \"wet\" is not a number",
        ),
        (
            format!("{HEADER}\n{row}\n0,60,20,100,4000\n"),
            "run.csv:3:1: time_s repeats: 0 s is also the time of the row before",
        ),
        (
            format!("{HEADER}\n0.5,60,20,100,4000\n0.25,60,20,100,4000\n"),
            "run.csv:3:1: time_s goes back: 0.25 s after 0.5 s",
        ),
        // A missing time orders nothing, the times around it must still be in order.
        (
            format!("{HEADER}\n0.5,60,20,100,4000\n,60,20,100,4000\n0.5,60,20,100,4000\n"),
            "run.csv:4:1: time_s repeats: 0.5 s is also the time of the row before",
        ),
        // Comments, empty lines, other line ends, quotes and a byte order mark do not move the place.
        (
            format!("# \u{e9}t\u{e9}\n{HEADER}\n\n# note\n{row}\n# note\n1,60,20,x,4000\n"),
            "run.csv:7:9: drag_force_n: \"x\" is not a number",
        ),
        (
            format!("{HEADER}\r\n{row}\r\n\r\n1,60,20,x,4000\r\n"),
            "run.csv:4:9: drag_force_n: \"x\" is not a number",
        ),
        (
            format!("\u{feff}{HEADER}\n\"0\",\"60\",\"20\",x,4000\n"),
            "run.csv:2:15: drag_force_n: \"x\" is not a number",
        ),
        (
            format!("\u{feff}{HEADER},drag_force_n\n"),
            "run.csv:1:72: column \"drag_force_n\" appears twice",
        ),
        (
            format!("{HEADER},\"a,b\"\n0,60,20,100,4000,\"1\n2\"\n"),
            "run.csv:2:18: a,b: \"1\\n2\" is not a number",
        ),
        (
            format!("{HEADER}\n0,60,20,\"x\"\"y\",4000\n"),
            "run.csv:2:9: drag_force_n: \"x\\\"y\" is not a number",
        ),
        // A decimal comma is too many cells.
        (
            format!("{HEADER}\n0,0,60,20,100,4000\n"),
            "run.csv:2:15: 6 cells where the header has 5",
        ),
    ] {
        assert_eq!(complaint(&contents), expected, "{contents:?}");
    }
}

#[test]
fn bytes_that_are_not_utf8_are_told_where_they_are() {
    let with = |before: &str, after: &str| [before.as_bytes(), b"\xe9", after.as_bytes()].concat();
    for (contents, expected) in [
        (with("", ""), "run.csv:1:1: not UTF-8 text"),
        (
            with(&format!("{HEADER}\n0,60,2"), ",1,1\n"),
            "run.csv:2:7: not UTF-8 text",
        ),
        (
            with("# caf", &format!("\n{HEADER}\n")),
            "run.csv:1:6: not UTF-8 text",
        ),
        (
            with(&format!("{HEADER}\n0,1,2,3,4\n"), ""),
            "run.csv:3:1: not UTF-8 text",
        ),
        (
            b"\xff\xfet\0i\0m\0e\0".to_vec(),
            "run.csv:1:1: not UTF-8 text",
        ),
    ] {
        assert_eq!(complaint(&contents), expected);
    }
    // What is wrong further up is told first.
    let both = with(&format!("{HEADER}\n0,x,2,3,4\n"), "");
    assert_eq!(
        complaint(&both),
        "run.csv:2:3: wheel_speed_rad_s: \"x\" is not a number"
    );
}

#[test]
fn far_down_a_long_file_the_place_is_still_exact() {
    let mut contents = format!("{HEADER}\n");
    for index in 0..50_000 {
        contents += &format!("{index},60,20,100,4000\n");
        if index % 7 == 0 {
            contents += "# \u{20ac}\n";
        }
    }
    let lines = contents.lines().count();
    contents += "50000,60,20,100,\u{e9}\n";
    let expected = format!(
        "run.csv:{}:17: normal_force_n: \"\u{e9}\" is not a number",
        lines + 1
    );
    assert_eq!(complaint(&contents), expected);
}

#[test]
fn the_same_rows_in_any_dress_are_read_the_same() {
    let plain = format!(
        "{HEADER},temperature\n0,60,20,100,4000,31.5\n0.1,59,19,,nan,\n0.2,inf,1e308,-1E-3,+5,.5\n"
    );
    let expected = read(plain.as_bytes(), Required::DragIncluded).unwrap();
    assert_eq!(expected.rows(), 3);
    let drag = expected.channel(Channel::DragForce).unwrap();
    assert!(drag[0] == 100.0 && drag[1].is_nan() && drag[2] == -1e-3);
    assert!(expected.channel(Channel::NormalForce).unwrap()[1].is_nan());
    assert_eq!(
        expected.channel(Channel::WheelSpeed).unwrap()[2],
        f64::INFINITY
    );
    assert_eq!(expected.channel(Channel::VehicleSpeed).unwrap()[2], 1e308);
    let (name, temperature) = expected.extra().next().unwrap();
    assert_eq!(
        (name, temperature[0], temperature[2]),
        ("temperature", 31.5, 0.5)
    );
    assert!(expected.channel(Channel::BrakeTorque).is_none());
    for dressed in [
        plain.replace('\n', "\r\n"),
        plain.replace('\n', "\r"),
        format!("\u{feff}{plain}"),
        format!(
            "# comment\n\n{}",
            plain.replace("\n0.1", "\n# more, \"of\" it\n\n0.1")
        ),
        plain
            .replace("60,20", "\"60\", 20 ")
            .replace("drag_force_n", " \"drag_force_n\""),
        plain.trim_end().to_owned(),
    ] {
        let dressed = dressed.replace(" \"drag_force_n\"", "\"drag_force_n\"");
        let run = read(dressed.as_bytes(), Required::DragIncluded).unwrap();
        assert_eq!(run.header(), expected.header(), "{dressed:?}");
        for (a, b) in run.columns().iter().zip(expected.columns()) {
            assert_eq!(format!("{a:?}"), format!("{b:?}"), "{dressed:?}");
        }
    }
}

#[test]
fn a_recording_without_drag_is_read_where_drag_is_optional() {
    let contents = "time_s,wheel_speed_rad_s,vehicle_speed_m_s,normal_force_n\n0,60,20,4000\n";
    let run = read(contents.as_bytes(), Required::DragOptional).unwrap();
    assert!(run.channel(Channel::DragForce).is_none());
    assert_eq!(run.rows(), 1);
}

#[test]
fn files_that_cannot_be_read_are_told_in_one_line() {
    let scratch = Scratch::with_rig(RIG);
    fs::create_dir(scratch.path("folder")).unwrap();
    for (name, expected) in [
        (
            "nowhere.csv",
            "nowhere.csv:1:1: cannot be read: no such file or directory",
        ),
        ("folder", "folder:1:1: cannot be read: is a directory"),
    ] {
        for command in ["estimate", "fit"] {
            assert_eq!(
                scratch.complaint(&[command, "--rig", "rig.toml", name]),
                expected
            );
        }
    }
}

#[test]
fn a_recording_may_be_read_several_times_and_keeps_its_errors() {
    let scratch = Scratch::new();
    scratch.write(
        "run.csv",
        format!("{HEADER}\n0,60,20,100,4000\n1,60,20,x,4000\n"),
    );
    let mut recording = Recording::open(&scratch.path("run.csv")).unwrap();
    for _ in 0..3 {
        let mut rows = recording.rows(Required::DragIncluded).unwrap();
        assert_eq!(rows.next_row().unwrap().unwrap().time_s(), 0.0);
        let error = rows.next_row().unwrap_err();
        assert_eq!((error.line, error.column), (3, 9));
    }
}

#[cfg(unix)]
#[test]
fn a_recording_may_come_through_a_pipe() {
    let scratch = Scratch::with_rig(RIG);
    let points = test_support::scenario::article::measurements(1);
    let text = crate::common::recording_of(points);
    scratch.write("run.csv", &text);
    let arguments = ["estimate", "--rig", "rig.toml", "--json"];
    let from_file = scratch.json(&[&arguments[..], &["run.csv"]].concat());
    let output = scratch
        .muslip(&[&arguments[..], &["/dev/stdin"]].concat())
        .write_stdin(text)
        .output()
        .unwrap();
    let from_pipe: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(from_pipe, from_file);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        if let Err(text) = read(&bytes, Required::DragIncluded) {
            prop_assert_eq!(text.lines().count(), 1);
        }
    }

    #[test]
    fn a_damaged_recording_never_panics_and_is_told_within_the_file(
        rows in proptest::collection::vec("[-+]?[0-9]{1,3}(\\.[0-9]{1,3})?,(nan|1e308|inf||-0),\"?[0-9 ]{1,3}\"?,[0-9]{1,3},[0-9]{1,4}(\r?\n|,|\n#x\n)", 0..8),
        at in any::<prop::sample::Index>(),
        with in any::<u8>(),
    ) {
        let mut bytes = format!("{HEADER}\n{}", rows.concat()).into_bytes();
        let place = at.index(bytes.len());
        bytes[place] = with;
        let lines = bytes.iter().filter(|byte| matches!(byte, b'\n' | b'\r')).count() as u64 + 1;
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&bytes).unwrap();
        if let Err(error) = Run::read(file.path(), Required::DragIncluded) {
            prop_assert!((1..=lines).contains(&error.line), "{}", error);
            prop_assert!(error.column >= 1 && error.column <= bytes.len() as u64 + 1);
            prop_assert_eq!(error.to_string().lines().count(), 1);
        }
    }

    #[test]
    fn what_the_writer_writes_the_reader_reads(
        values in proptest::collection::vec(proptest::collection::vec(-1e9..1e9f64, 4), 1..20),
    ) {
        let names = HEADER.split(',').collect::<Vec<_>>();
        let mut writer =
            muslip_recordings::recording::RecordingWriter::new(Vec::new(), &["origin".into()], &names).unwrap();
        for (index, row) in values.iter().enumerate() {
            writer.row(&[&[index as f64][..], row].concat()).unwrap();
        }
        let run = read(&writer.into_inner(), Required::DragIncluded).unwrap();
        for (index, row) in values.iter().enumerate() {
            for (column, value) in run.columns()[1..].iter().zip(row) {
                prop_assert!((column[index] - value).abs() <= 1e-8 * value.abs());
            }
        }
    }
}

#[test]
fn bundled_recordings_are_sound() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../crates/muslip-cli/demo");
    let run = Run::read(&folder.join("run.csv"), Required::DragIncluded).unwrap();
    assert!(run.rows() > 1000);
    assert!(fs::metadata(folder.join("run.csv")).unwrap().len() < 300_000);
}
