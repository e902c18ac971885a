//! Files of figures: budgets and what runs measured, one `name = number` a line.

use std::collections::BTreeMap;

use anyhow::{Context, Result};

/// Lines of `name = number`.
pub fn figures(text: &str) -> Result<BTreeMap<String, u64>> {
    text.lines()
        .map(|line| line.split('#').next().unwrap_or("").trim())
        .filter(|line| !line.is_empty())
        .map(|line| {
            let (name, value) = line.split_once('=').context("no = in a line of figures")?;
            Ok((name.trim().to_owned(), value.trim().parse()?))
        })
        .collect()
}

/// The text with what stands between two marks replaced.
pub fn replaced_between(text: &str, [begin, end]: [&str; 2], table: &str) -> Result<String> {
    let (before, rest) = text
        .split_once(begin)
        .with_context(|| format!("no {begin}"))?;
    let (_, after) = rest.split_once(end).with_context(|| format!("no {end}"))?;
    Ok(format!("{before}{begin}\n{table}{end}{after}"))
}

#[cfg(test)]
mod tests {
    use super::{figures, replaced_between};

    #[test]
    fn figures_are_read_without_their_comments() {
        let read = figures("# words\nflash_bytes = 98304  # more\n\nram = 1\n").unwrap();
        assert_eq!(read.len(), 2);
        assert_eq!(read["flash_bytes"], 98_304);
        assert!(figures("flash_bytes 3").is_err());
        assert!(figures("flash_bytes = x").is_err());
    }

    #[test]
    fn only_what_is_between_the_marks_is_replaced() {
        let text = "a\n<1>\nold\n<2>\nb\n";
        let new = replaced_between(text, ["<1>", "<2>"], "new\n").unwrap();
        assert_eq!(new, "a\n<1>\nnew\n<2>\nb\n");
        assert!(replaced_between(text, ["<1>", "<3>"], "new\n").is_err());
    }
}
