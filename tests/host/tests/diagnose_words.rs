//! What the terminal, the report and the two files say of a diagnosis.

use std::path::Path;

use crate::diagnosis::{assert_valid, consistent, monstrous, partly_explained, with_chain};
use muslip_analysis::diagnose::json;
use muslip_diagnose::outcome::{BeforeAfter, Diagnosis, Fit, LookedFor, Verdict};
use muslip_recordings::model_file;
use muslip_recordings::model_file::ModelFile;
use muslip_report::diagnose::summary::{MOST_LINES, WIDEST_LINE, summary};
use muslip_report::diagnose::views::Views;
use muslip_report::diagnose::{files, page};

fn told(diagnosis: &Diagnosis) -> String {
    told_within(diagnosis, WIDEST_LINE)
}

fn told_within(diagnosis: &Diagnosis, width: usize) -> String {
    let summary = summary(diagnosis, Path::new("found"), width);
    let lines: Vec<String> = summary.verdict.into_iter().chain(summary.lines).collect();
    lines.join("\n") + "\n"
}

fn undecided() -> Diagnosis {
    Diagnosis {
        verdict: Verdict::Undecided,
        fit: Fit {
            fit: BeforeAfter::default(),
            holdout: BeforeAfter::default(),
        },
        data_faults: partly_explained().data_faults,
        traces: vec![],
        looked_for: consistent()
            .looked_for
            .into_iter()
            .map(|entry| LookedFor {
                identifiable: false,
                minimum_detectable: None,
                ..entry
            })
            .collect(),
        ..consistent()
    }
}

#[test]
fn the_terminal_says_what_an_engineer_would_write() {
    insta::assert_snapshot!("diagnose_partly_explained", told(&partly_explained()));
    insta::assert_snapshot!("diagnose_consistent", told(&consistent()));
    insta::assert_snapshot!("diagnose_undecided", told(&undecided()));
}

#[test]
fn a_summary_fits_its_lines_whatever_was_found() {
    for mut diagnosis in [partly_explained(), consistent(), undecided(), monstrous()] {
        for finite in [false, true] {
            if finite {
                json::make_finite(&mut diagnosis);
            }
            for width in [60, 80, WIDEST_LINE] {
                let text = told_within(&diagnosis, width);
                assert!(text.lines().count() <= MOST_LINES, "{text}");
                for line in text.lines() {
                    assert!(line.chars().count() <= width, "{line}");
                    assert!(!line.chars().any(char::is_control), "{line:?}");
                }
            }
        }
    }
}

#[test]
fn every_diagnosis_is_written_as_the_contract_s_schema_wants_it() {
    for mut diagnosis in [partly_explained(), consistent(), undecided(), monstrous()] {
        json::make_finite(&mut diagnosis);
        let text = json::to_text(&diagnosis).unwrap();
        assert_valid(&text);
        // serde_json writes null for what is no number: only where the contract allows none.
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(nulls(&value, "").iter().find(|path| !allowed(path)), None);
    }
}

fn allowed(path: &str) -> bool {
    ["declared", "whiteness_p", "minimum_detectable"]
        .iter()
        .any(|end| path.ends_with(end))
}

fn nulls(value: &serde_json::Value, path: &str) -> Vec<String> {
    match value {
        serde_json::Value::Null => vec![path.to_owned()],
        serde_json::Value::Array(items) => items
            .iter()
            .enumerate()
            .flat_map(|(index, item)| nulls(item, &format!("{path}[{index}]")))
            .collect(),
        serde_json::Value::Object(entries) => entries
            .iter()
            .flat_map(|(key, item)| nulls(item, &format!("{path}.{key}")))
            .collect(),
        _ => Vec::new(),
    }
}

#[test]
fn making_a_diagnosis_finite_leaves_a_finite_one_as_it_is() {
    let mut diagnosis = partly_explained();
    let before = json::to_text(&diagnosis).unwrap();
    json::make_finite(&mut diagnosis);
    assert_eq!(json::to_text(&diagnosis).unwrap(), before);
}

#[test]
fn an_unknown_figure_is_never_a_sure_one() {
    let mut diagnosis = monstrous();
    json::make_finite(&mut diagnosis);
    for mechanism in &diagnosis.mechanisms {
        let figure = &mechanism.parameters[0];
        assert_eq!((figure.value, figure.std), (0.0, f64::MAX));
        assert_eq!(mechanism.evidence.confidence, 0.0);
    }
}

#[test]
fn every_digit_of_a_number_survives_the_files() {
    let diagnosis = partly_explained();
    let text = json::to_text(&diagnosis).unwrap();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        value["mechanisms"][0]["parameters"][0]["value"].as_f64(),
        Some(diagnosis.mechanisms[0].parameters[0].value)
    );
    let text = model_file::to_text(&diagnosis.repaired, "about\nthis").unwrap();
    let model = ModelFile::parse(Path::new("model.toml"), text.as_bytes()).unwrap();
    assert_eq!(model.repaired, diagnosis.repaired);
    assert!(text.contains("\n# about this\n"), "{text}");
}

#[test]
fn the_report_shows_every_part_and_without_plots_runs_no_script() {
    let page = page::report(
        &partly_explained(),
        &Views::default(),
        "muslip diagnose <x>",
    )
    .to_html()
    .unwrap();
    for part in [
        "What is missing",
        "Before and after",
        "How much better",
        "Where",
        "What was looked for",
        "Data",
        "Force lag",
        "time_constant * d(reading)/dt + reading = drag",
        "could also be",
        ">relaxation length (5",
        "Repeat at half and at twice the speed",
        "depends on vehicle speed",
        "held-out data, repaired model",
        "frozen or clipped",
        "muslip diagnose &#60;x&#62;",
    ] {
        assert!(page.contains(part), "{part}");
    }
    for mut diagnosis in [consistent(), undecided(), monstrous()] {
        json::make_finite(&mut diagnosis);
        let drawn = |diagnosis: &Diagnosis| {
            page::report(diagnosis, &Views::default(), "muslip diagnose")
                .to_html()
                .unwrap()
        };
        let page = drawn(&diagnosis);
        let words_and_data = page.split("<script>").next().unwrap();
        assert!(!words_and_data.contains("NaN"));
        diagnosis.traces.clear();
        diagnosis.repaired.corrections.clear();
        assert!(!drawn(&diagnosis).contains("<script"));
    }
}

#[test]
fn a_column_named_like_markup_is_text_in_the_report() {
    let named = "<script>alert(1)</script>";
    let mut diagnosis = partly_explained();
    let usual = page::report(&diagnosis, &Views::default(), "muslip")
        .to_html()
        .unwrap();
    diagnosis.unexplained[0].variable = named.to_owned();
    diagnosis.data_faults[0].channel = named.to_owned();
    diagnosis.regions[0].variable = named.to_owned();
    diagnosis.recordings[0].path = named.to_owned();
    let page = page::report(&diagnosis, &Views::default(), "muslip")
        .to_html()
        .unwrap();
    assert_eq!(
        page.matches("<script").count(),
        usual.matches("<script").count()
    );
    assert!(
        page.matches("&#60;script&#62;alert(1)").count() >= 4,
        "{page}"
    );
}

#[test]
fn a_failure_to_write_leaves_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("found");
    files::write(&out, &consistent(), &Views::default(), "first").unwrap();
    let before = read_all(&out);
    assert_eq!(
        before
            .iter()
            .map(|(name, _)| name.as_str())
            .collect::<Vec<_>>(),
        files::FILES
    );
    // The last of the three cannot be made: a folder has its name.
    std::fs::remove_file(out.join("report.html")).unwrap();
    std::fs::create_dir(out.join("report.html")).unwrap();
    let error = files::write(&out, &partly_explained(), &Views::default(), "second").unwrap_err();
    assert!(
        error
            .to_string()
            .contains("report.html:1:1: cannot be written"),
        "{error}"
    );
    std::fs::remove_dir(out.join("report.html")).unwrap();
    assert_eq!(read_all(&out), before[..2]);
}

fn read_all(folder: &Path) -> Vec<(String, String)> {
    let mut files: Vec<(String, String)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| {
            let entry = entry.unwrap();
            let name = entry.file_name().into_string().unwrap();
            (name, std::fs::read_to_string(entry.path()).unwrap())
        })
        .collect();
    files.sort();
    files
}

#[test]
fn the_chain_s_findings_come_before_the_physics_and_only_where_there_are_some() {
    let mut diagnosis = with_chain(partly_explained());
    json::make_finite(&mut diagnosis);
    assert_valid(&json::to_text(&diagnosis).unwrap());
    let told = told(&diagnosis);
    let place =
        |text: &str, part: &str| text.find(part).unwrap_or_else(|| panic!("{part}: {text}"));
    assert!(place(&told, "The vehicle speed comes 66 ms later") < place(&told, "Where "));
    assert!(
        told.contains("Explain  muslip explain force_lag wheel_inertia\n"),
        "{told}"
    );
    assert!(told.lines().count() <= MOST_LINES);
    let html = |diagnosis: &Diagnosis| {
        page::report(diagnosis, &Views::default(), "")
            .to_html()
            .unwrap()
    };
    let page = html(&diagnosis);
    assert!(place(&page, "The measuring chain") < place(&page, "What is missing"));
    assert!(!html(&partly_explained()).contains("The measuring chain"));
    let nothing = summary(&consistent(), Path::new("found"), WIDEST_LINE);
    assert!(!nothing.lines.join("\n").contains("Explain"));
}

#[test]
fn every_name_of_the_report_leads_to_what_it_means() {
    let page = page::report(&partly_explained(), &Views::default(), "")
        .to_html()
        .unwrap();
    let mut links = 0;
    for link in page.split("href=\"#").skip(1) {
        let target = link.split('"').next().unwrap();
        assert!(page.contains(&format!("id=\"{target}\"")), "{target}");
        links += 1;
    }
    // At least each of those looked for, and what was named.
    assert!(links > muslip_diagnose::mechanism::Id::ALL.len(), "{links}");
}
