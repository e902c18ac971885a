//! A constant that can be set, and that tells whether half or twice of it could have changed a result.
//!
//! The text of this file goes into the changed engine ([`super::tunable`]); here its words and names are used, and its tests run.

use std::cmp::Ordering;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Component, Path};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Environment variable that sets one constant: `path=value`.
pub const SET: &str = "MUSLIP_CONSTANT";
/// Environment variable with the folder for what constants tell: one file a campaign, a path and a word a line.
pub const TOLD: &str = "MUSLIP_CONSTANTS_TOLD";

/// What is told: that half of it, or twice of it, compares otherwise, or that its value was taken for more than a comparison.
pub const WORDS: [&str; 3] = ["halved", "doubled", "taken"];

/// A constant.
pub struct Kept<T> {
    path: &'static str,
    value: T,
    varied: [T; 2],
    told: [AtomicBool; 3],
}

impl<T: Copy> Kept<T> {
    /// With this value, or the one that is set, and half and twice of it.
    ///
    /// # Panics
    /// Where what is set is no number.
    pub fn new(path: &'static str, value: T, varied: [T; 2], convert: fn(f64) -> T) -> Self {
        let set = std::env::var(SET).unwrap_or_default();
        let own = set.strip_prefix(path).and_then(|set| set.strip_prefix('='));
        Self {
            path,
            value: own.map_or(value, |own| convert(own.parse().expect("a number"))),
            varied,
            told: [const { AtomicBool::new(false) }; 3],
        }
    }

    /// Its value, for more than a comparison.
    pub fn taken(&self) -> T {
        self.tell(2);
        self.value
    }

    /// How its value compares. Where that is as half and twice of it compare, neither would have changed what comes of it.
    pub fn compared(&self, order: impl Fn(T) -> Option<Ordering>) -> Option<Ordering> {
        let own = order(self.value);
        for (at, other) in self.varied.into_iter().enumerate() {
            if order(other) != own {
                self.tell(at);
            }
        }
        own
    }

    fn tell(&self, at: usize) {
        if self.told[at].swap(true, Relaxed) {
            return;
        }
        let Some(folder) = std::env::var_os(TOLD) else {
            return;
        };
        let campaign = std::env::args().find_map(|argument| campaign_of(&argument));
        let file = Path::new(&folder).join(campaign.expect("a campaign among the arguments"));
        let file = OpenOptions::new().create(true).append(true).open(file);
        let line = format!("{} {}\n", self.path, WORDS[at]);
        file.and_then(|mut file| file.write_all(line.as_bytes()))
            .expect("room for a line");
    }
}

/// The folder of a campaign in a path.
fn campaign_of(path: &str) -> Option<String> {
    let of_folder = |component: Component<'_>| {
        let name = component.as_os_str().to_str()?;
        name.starts_with("campaign-").then(|| name.to_owned())
    };
    Path::new(path).components().find_map(of_folder)
}

/// A constant that is compared.
#[derive(Clone, Copy)]
pub struct Compared<T: 'static>(pub &'static Kept<T>);

macro_rules! compared_with {
    ($($kind:ty),*) => {$(
        impl PartialEq<Compared<$kind>> for $kind {
            fn eq(&self, other: &Compared<$kind>) -> bool {
                self.partial_cmp(other) == Some(Ordering::Equal)
            }
        }
        impl PartialOrd<Compared<$kind>> for $kind {
            fn partial_cmp(&self, other: &Compared<$kind>) -> Option<Ordering> {
                other.0.compared(|value| self.partial_cmp(&value))
            }
        }
        impl PartialEq<$kind> for Compared<$kind> {
            fn eq(&self, other: &$kind) -> bool {
                self.partial_cmp(other) == Some(Ordering::Equal)
            }
        }
        impl PartialOrd<$kind> for Compared<$kind> {
            fn partial_cmp(&self, other: &$kind) -> Option<Ordering> {
                self.0.compared(|value| value.partial_cmp(other))
            }
        }
    )*};
}
compared_with!(f64, usize, isize);

#[cfg(test)]
mod tests {
    use super::*;

    /// What is told of a constant of two that these are compared with.
    fn told(compare: impl Fn(Compared<f64>)) -> [bool; 3] {
        let kept = Kept::new("constants::TWO", 2.0, [1.0, 4.0], |value| value);
        let kept: &'static Kept<f64> = Box::leak(Box::new(kept));
        compare(Compared(kept));
        kept.told.each_ref().map(|told| told.load(Relaxed))
    }

    #[test]
    fn a_constant_tells_which_other_value_compares_otherwise() {
        assert_eq!(told(|two| assert!(5.0 > two)), [false; 3]);
        assert_eq!(told(|two| assert!(3.0 >= two)), [false, true, false]);
        assert_eq!(told(|two| assert!(two > 1.5)), [true, false, false]);
        assert_eq!(
            told(|two| assert_eq!(two.0.taken(), 2.0)),
            [false, false, true]
        );
    }

    #[test]
    fn a_campaign_is_the_folder_of_its_recordings() {
        let of = |path: &str| campaign_of(path);
        assert_eq!(
            of("target/a/campaign-0012/run01.csv").as_deref(),
            Some("campaign-0012")
        );
        assert_eq!(of("target/campaigns-61-2/rig.toml"), None);
    }
}
