//! What other programs wrote is read, value for value; fewer samples than written is a failure.

use std::collections::BTreeMap;

use formats_tests::{Judged, files, folder, judged, origin};

#[test]
fn every_value_that_was_written_is_read() {
    let Some(folder) = folder() else { return };
    let all = files(&folder);
    assert!(
        all.len() > 150,
        "{} files in {}",
        all.len(),
        folder.display()
    );
    let mut by_origin: BTreeMap<&str, (usize, Judged)> = BTreeMap::new();
    for (path, written) in &all {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let Judged {
            read,
            refused,
            wrong,
        } = judged(path, written);
        let (files, sum) = by_origin.entry(origin(&name)).or_default();
        *files += 1;
        sum.read += read;
        sum.refused.extend(refused);
        let wrong = wrong.into_iter().map(|line| format!("{name}: {line}"));
        sum.wrong.extend(wrong);
    }
    let mut table = String::from(
        "| files of | files | channels read | refused with a reason | wrong |\n| --- | --- | --- | --- | --- |\n",
    );
    for (origin, (files, sum)) in &by_origin {
        let (refused, wrong) = (sum.refused.len(), sum.wrong.len());
        table.push_str(&format!(
            "| {origin} | {files} | {} | {refused} | {wrong} |\n",
            sum.read
        ));
    }
    println!("{table}");
    if let Some(path) = std::env::var_os("MUSLIP_FORMATS_TABLE") {
        std::fs::write(path, table).unwrap();
    }
    for reason in by_origin.values().flat_map(|(_, sum)| &sum.refused) {
        println!("refused: {reason}");
    }
    let wrong: Vec<&String> = by_origin.values().flat_map(|(_, sum)| &sum.wrong).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}
