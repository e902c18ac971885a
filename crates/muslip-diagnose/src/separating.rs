//! The run that would tell two mechanisms apart: what their descriptors say.

use crate::mechanism::Id;

/// Where neither of two says that it is mistaken for the other, nor for anything else.
const ANY: &str = "Repeat the ramp at two speeds and two loads, with a free-rolling stretch and a standstill before and after.";

/// The run that tells these two apart, in one sentence; that of one of them and its likest where nobody takes the
/// two for each other.
#[must_use]
pub fn separating_test(a: Id, b: Id) -> &'static str {
    let (of_a, of_b) = (a.aliases(), b.aliases());
    let both = of_a.iter().find(|alias| alias.with == b);
    both.or(of_a.first())
        .or(of_b.first())
        .map_or(ANY, |alias| alias.run)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_has_a_run_that_would_tell_it_apart() {
        for &a in Id::ALL {
            for &b in Id::ALL {
                assert!(separating_test(a, b).len() > 40);
            }
        }
        assert!(separating_test(Id::LoadCrosstalk, Id::RollingResistance).contains("standing"));
        assert!(separating_test(Id::RelaxationLength, Id::ForceLag).contains("speed"));
    }
}
