//! The scenarios, one module each and one program: what they link is most of the workspace.

mod browser;
mod common;
mod diagnosis;

mod command_line;
mod compensated_estimate;
mod contract;
mod diagnose_files;
mod diagnose_measured;
mod diagnose_model;
mod diagnose_words;
mod effects;
mod estimate;
mod every_mechanism;
mod explain;
mod fit;
mod formats;
mod model_simulated;
mod pages;
mod recordings;
mod rig;
mod simulate;

#[test]
fn every_file_of_the_folder_is_a_module_here() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        let source =
            path.extension().is_some_and(|end| end == "rs") || path.join("mod.rs").exists();
        let here = name == "scenarios"
            || include_str!("scenarios.rs").contains(&format!("\nmod {name};\n"));
        assert!(
            here || !source,
            "tests/host/tests/scenarios.rs lacks `mod {name};`"
        );
    }
}
