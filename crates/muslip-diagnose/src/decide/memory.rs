//! Whose memory it is: a tyre's goes by how far it has rolled, a chain's by the clock.

use super::next::touches;
use super::rank::{much_more, softness};
use super::trial::Trial;
use crate::constants::FAR_HEAVIER;
use crate::data::Data;
use crate::mechanism::{Balance, Id, Kind, Memory};

/// Whether more speaks for a memory of the chain's than for a name: clearly more, but where a chain leaves what looks like the
/// name, too, for that has nothing but its weight to speak for it.
pub fn outweighs(memory: &Trial, trial: &Trial) -> bool {
    let least = if trial.fed_by_chain {
        0.0
    } else {
        softness(memory.weight())
    };
    memory.weight() - trial.weight() > least
}

/// The heaviest of these that far outweighs a memory of the chain's and touches a balance of its own: a brake that comes late
/// is a drag that does, in the wheel's balance, and says nothing of the tyre's.
pub fn far_heavier<'a>(data: &Data, memory: &Trial, all: &'a [Trial]) -> Option<&'a Trial> {
    let own = touches(data, memory);
    let could_leave_it = |other: &&Trial| {
        let outweighs = other.weight() > FAR_HEAVIER * memory.weight();
        outweighs && touches(data, other).iter().any(|of| own.contains(of))
    };
    let heavier = all.iter().filter(could_leave_it);
    heavier.max_by(|a, b| a.weight().total_cmp(&b.weight()))
}

/// Whose memory of the tyre's balance a trial is of.
pub fn memory_of(data: &Data, trial: &Trial) -> Option<Kind> {
    let (_, entry) = trial.mechanism().filter(|_| trial.remembers)?;
    let mechanism = data.catalogue.get(entry);
    (mechanism.id().balance() == Balance::Tyre).then(|| mechanism.guide().kind)
}

/// Memories of the drag that go by the clock.
pub fn clocks_of(data: &Data) -> Vec<Id> {
    let entries = data.catalogue.entries().iter();
    let clocks = entries.filter(|mechanism| {
        let guide = mechanism.guide();
        let of_drag = mechanism.facts().through_force && mechanism.id().balance() == Balance::Tyre;
        of_drag && guide.memory == Memory::Kernel && guide.kind != Kind::Tyre
    });
    let mut ids: Vec<Id> = clocks.map(|mechanism| mechanism.id()).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// What a trial gains at both levels of the noise, nats.
pub fn gains_of(trial: &Trial) -> [f64; 2] {
    [trial.gain, trial.at_sensors.0].map(|gain| gain.max(0.0))
}

/// Whether a trial gains much more than this at both levels of the noise.
pub fn says_much_more(trial: &Trial, than: [f64; 2]) -> bool {
    much_more(trial.gain, than[0]) && much_more(trial.at_sensors.0, than[1])
}

/// Lets a memory of the tyre that the timing is too vague for outlast the chain where it says much more than every memory
/// of the drag that goes by the clock, each with what it gains: a tyre goes by how far it has rolled. From none nothing is
/// told.
pub fn tell_from_clocks(data: &Data, trials: &mut [Trial], clocks: &[[f64; 2]]) {
    if clocks.is_empty() {
        return;
    }
    let own = trials.iter_mut();
    for trial in own.filter(|t| t.lasts && memory_of(data, t) == Some(Kind::Tyre)) {
        trial.outlasts_chain |= clocks.iter().all(|clock| says_much_more(trial, *clock));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decide::toy::of_name;
    use crate::innovations::toy::{self, Noise, stop};

    #[test]
    fn a_tyre_s_memory_that_outweighs_all_in_time_is_none_of_the_chain_s() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let memory = |id, nats, at_sensors| Trial {
            remembers: true,
            lasts: true,
            outlasts_chain: false,
            at_sensors: (at_sensors, 3.0),
            ..of_name(&data, &base, id, nats, 3.0)
        };
        let told_from = |clocks: &[[f64; 2]]| {
            let mut trials = [
                memory(Id::RelaxationLength, 72.0, 85.0),
                memory(Id::ForceLag, 72.0, 85.0),
            ];
            tell_from_clocks(&data, &mut trials, clocks);
            trials.map(|t| t.outlasts_chain)
        };
        let told = |lag| told_from(&[[0.0; 2], lag]);
        // Much more is a third and 15 nats; of the lag itself nothing is said.
        assert_eq!(told([2.0, 8.0]), [true, false]);
        assert_eq!(told([45.0, 8.0]), [false, false]);
        assert_eq!(told([2.0, 60.0]), [false, false]);
        // What was not asked cannot be told from.
        assert_eq!(told_from(&[]), [false, false]);
    }

    #[test]
    fn a_lag_a_delay_and_a_mode_of_the_load_cell_go_by_the_clock() {
        let data = stop(Noise::TYPICAL, 4);
        assert_eq!(
            clocks_of(&data),
            [Id::ForceDelay, Id::ForceLag, Id::StructuralResonance]
        );
    }

    #[test]
    fn a_memory_is_asked_for_beside_the_heaviest_that_could_leave_it_in_a_balance_of_both() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let of = |id, nats| of_name(&data, &base, id, nats, 3.0);
        let all = [
            of(Id::BrakeLag, 1300.0),
            of(Id::WheelInertia, 1500.0),
            of(Id::CurveShape, 2000.0),
            of(Id::ForceLag, 900.0),
        ];
        let heavier = |id, nats| {
            let other = far_heavier(&data, &of(id, nats), &all)?;
            Some(other.mechanism()?.0)
        };
        assert_eq!(heavier(Id::ForceDelay, 500.0), Some(Id::CurveShape));
        // A curve is the tyre's alone.
        assert_eq!(heavier(Id::BrakeLag, 700.0), Some(Id::WheelInertia));
        assert_eq!(heavier(Id::CurveShape, 1300.0), None);
        assert_eq!(heavier(Id::ForceDelay, 1001.0), None);
    }

    #[test]
    fn what_a_chain_leaves_too_is_outweighed_by_any_memory_of_the_chain_that_is_heavier() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let of = |id, nats, fed_by_chain| Trial {
            fed_by_chain,
            ..of_name(&data, &base, id, nats, 3.0)
        };
        // Softness of 100 nats is 7.
        let memory = of(Id::RelaxationLength, 100.0, true);
        assert!(outweighs(&memory, &of(Id::SlipHysteresis, 99.0, true)));
        assert!(!outweighs(&memory, &of(Id::SlipHysteresis, 101.0, true)));
        assert!(!outweighs(&memory, &of(Id::LoadSensitivity, 94.0, false)));
        assert!(outweighs(&memory, &of(Id::LoadSensitivity, 92.0, false)));
    }
}
