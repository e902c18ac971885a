//! Energy in the brake, in memory that a reset leaves alone: a reset does not cool it.
//!
//! Two copies, each with its complement, written one after the other on every sample: a reset in the middle spoils one
//! of them at most. After power-up the memory holds anything, and the brake counts as cold.

/// Words of both copies.
pub const WORDS: usize = 4;

/// Anything but 0, so that memory that is all alike is no copy.
const MAGIC: u32 = 0x4D55_4845;

/// An energy in J as words.
#[must_use]
pub fn packed(energy_j: u32) -> [u32; WORDS] {
    let check = !energy_j ^ MAGIC;
    [energy_j, check, energy_j, check]
}

/// The energy in J that words hold: the larger where the copies differ, 0 where neither is one.
#[must_use]
pub fn unpacked(words: &[u32; WORDS]) -> u32 {
    let (copies, _) = words.as_chunks::<2>();
    copies
        .iter()
        .filter(|[energy_j, check]| *check == !energy_j ^ MAGIC)
        .map(|[energy_j, _]| *energy_j)
        .max()
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reset_between_any_two_words_leaves_the_energy_of_this_sample_or_the_one_before() {
        for (before, after) in [(0, 0), (1_000, 1_012), (5_000, 4_999), (u32::MAX, 7)] {
            for written in 0..=WORDS {
                let mut words = packed(before);
                words[..written].copy_from_slice(&packed(after)[..written]);
                let found = unpacked(&words);
                assert!(found == before || found == after, "{written}: {found}");
            }
        }
    }

    #[test]
    fn memory_that_holds_anything_is_a_cold_brake_and_one_spoilt_copy_none() {
        for words in [[0; 4], [u32::MAX; 4], [1, 2, 3, 4], [0xAAAA_AAAA; 4]] {
            assert_eq!(unpacked(&words), 0);
        }
        for bit in 0..64 {
            let mut words = packed(1_234);
            words[bit / 32] ^= 1 << (bit % 32);
            assert_eq!(unpacked(&words), 1_234, "bit {bit}");
        }
    }
}
