//! How the program came to its last end, in memory that a reset leaves alone.
//!
//! Words, with a check over them: after power-up the memory holds anything.

use muslip_record::{End, PostMortem, State};

/// Words of a record.
pub const WORDS: usize = 10;

const MAGIC: u32 = 0x4D55_4544;

/// A record's words.
#[must_use]
pub fn packed(record: &PostMortem) -> [u32; WORDS] {
    let mut words = [
        MAGIC,
        record.end as u32,
        record.program_counter,
        record.link_register,
        record.fault_status,
        record.hard_fault_status,
        record.address,
        record.state as u32,
        record.tick,
        0,
    ];
    let [body @ .., check] = &mut words;
    *check = checked(body);
    words
}

/// The record that words hold, if they hold one.
#[must_use]
pub fn unpacked(words: &[u32; WORDS]) -> Option<PostMortem> {
    let [body @ .., check] = words;
    let [
        MAGIC,
        end,
        program_counter,
        link_register,
        fault_status,
        hard_fault_status,
        address,
        state,
        tick,
    ] = *body
    else {
        return None;
    };
    if checked(body) != *check {
        return None;
    }
    Some(PostMortem {
        end: End::ALL.into_iter().find(|&other| other as u32 == end)?,
        program_counter,
        link_register,
        fault_status,
        hard_fault_status,
        address,
        state: state_of(state)?,
        tick,
    })
}

/// The state that is kept as this number.
#[must_use]
pub fn state_of(number: u32) -> Option<State> {
    State::ALL.into_iter().find(|&state| state as u32 == number)
}

/// FNV-1a over words.
fn checked(words: &[u32]) -> u32 {
    words.iter().fold(0x811c_9dc5, |hash, word| {
        (hash ^ word).wrapping_mul(0x0100_0193)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECORD: PostMortem = PostMortem {
        end: End::HardFault,
        program_counter: 0x0800_1234,
        link_register: 0xFFFF_FFF9,
        fault_status: 1 << 4,
        hard_fault_status: 1 << 30,
        address: 0x2000_0000,
        state: State::Ramp,
        tick: 77,
    };

    #[test]
    fn a_record_comes_back_and_any_bit_of_it_that_changed_makes_it_none() {
        let words = packed(&RECORD);
        assert_eq!(unpacked(&words), Some(RECORD));
        for bit in 0..32 * WORDS {
            let mut other = words;
            other[bit / 32] ^= 1 << (bit % 32);
            assert_eq!(unpacked(&other), None, "bit {bit}");
        }
    }

    #[test]
    fn every_end_and_state_is_told_apart() {
        for end in End::ALL {
            for state in State::ALL {
                let record = PostMortem {
                    end,
                    state,
                    ..RECORD
                };
                assert_eq!(unpacked(&packed(&record)), Some(record));
            }
        }
        assert_eq!(unpacked(&[0; WORDS]), None);
        assert_eq!(unpacked(&[u32::MAX; WORDS]), None);
    }
}
