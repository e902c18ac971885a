//! How late the channels are against the drag, what of it is taken off, and what is left to physics.

use super::correct::Lateness;
use super::untold::Untold;
use crate::audit::{Audit, Shown, Timing as Late};
use crate::constants::{
    ALIKE_LATE, ALIKE_LATE_S, AUDIT_REACH, FAR_BETTER, HEARD_S, IN_STEP_S, LATE_STDS,
    LEAST_BRAKE_EARLY_IN_STEP_S, LEAST_BRAKE_EARLY_S, LEAST_DRAG_LATE_S,
    LEAST_DRAG_LATE_UNCHAINED_S, LEAST_STDS_TOLD, SURE_DELAY, UNKNOWN_STDS, VAGUE_AUDIT_S, VAGUE_S,
};

/// Shifts are refined so often at most.
pub(super) const PASSES: usize = 5;
/// A shift that matters no more, in s.
pub(super) const SMALL_SHIFT_S: f64 = 1e-4;
/// Largest shift in one pass in s.
const MOST_SHIFT_S: f64 = 0.03;

/// How late the channels are against the drag channel, with what is not known of it.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// What is taken off.
    pub late: Lateness,
    /// What was found before any of it was left to be explained.
    pub(super) found: Lateness,
    /// Of the wheel speed, at its mean.
    pub wheel: Late,
    /// Of the vehicle speed.
    pub vehicle: Late,
    /// Of the brake.
    pub brake: Late,
    /// Whether the audit hears the brake's lateness: the fit alone may come to rest far from it.
    pub(super) brake_heard: bool,
    /// How late the drag is left, in s.
    drag: f64,
    /// Whether the brake's reading is left as early as it is.
    leaves_brake: bool,
    /// How early the wheel speed is left, in s.
    pub(super) wheel_left: f64,
    /// Whether no chain shows, and no channel was out of step once the drag, brake or wheel speed was left.
    unchained: bool,
}

/// Whether a channel is as late as the drag, as far as is known.
fn in_step(late: Late) -> bool {
    late.value.abs() < IN_STEP_S + 2.0 * late.std
}

/// Least lateness in s, known so well, that is left to be explained: what loggers and filters are out of step by unseen; where
/// none shows that there are such, what stands out of its own error.
fn least_left_s(chain_shows: bool, std: f64) -> f64 {
    if chain_shows {
        LEAST_DRAG_LATE_S
    } else {
        (LATE_STDS * std).clamp(LEAST_DRAG_LATE_UNCHAINED_S, LEAST_DRAG_LATE_S)
    }
}

impl Timing {
    /// A channel's lateness against the drag as recorded.
    #[must_use]
    pub fn against_drag(&self, late: Late) -> Late {
        Late {
            value: late.value - self.drag,
            ..late
        }
    }

    /// How late the drag is, in s, where a speed and all other channels are early, and alike: by what all of them are,
    /// for what one is early by beyond that is its own. Beside a wheel's speed and a brake that are, a vehicle's that is
    /// late says nothing against it: its receiver is. Of channels that have come through a chain that shows, two have to be
    /// early and none late: there the drag's own filter or logger may be what is late.
    fn drag_late(&self, chain_shows: bool) -> Option<f64> {
        let known = |l: &&Late| l.std < VAGUE_S;
        let early = |l: &Late| known(&l) && l.value < 0.0;
        let late_receiver =
            !chain_shows && early(&self.wheel) && early(&self.brake) && !early(&self.vehicle);
        let all = [self.wheel, self.brake, self.vehicle];
        let asked = &all[..if late_receiver { 2 } else { 3 }];
        // A brake alone says as little of the drag as the drag does of it.
        let speed = [self.wheel, self.vehicle].iter().any(|l| known(&l));
        let told = asked.iter().filter(known);
        let least = told.max_by(|a, b| a.value.total_cmp(&b.value))?;
        let late = -least.value;
        let alike =
            |l: &Late| (-l.value - late).abs() < ALIKE_LATE * late + ALIKE_LATE_S + 2.0 * l.std;
        let heard = |l: &&Late| l.std < HEARD_S;
        if chain_shows && all.iter().filter(known).count() < 2 {
            return None;
        }
        let stands_out = late > least_left_s(chain_shows, least.std);
        (speed && stands_out && asked.iter().filter(heard).all(alike)).then_some(late)
    }

    /// Leaves the drag as late as it is against all others.
    fn leave(&mut self, drag: f64) {
        self.drag = drag;
        self.late.wheel += drag;
        self.late.vehicle += drag;
        self.late.brake += drag;
        for late in [&mut self.wheel, &mut self.vehicle, &mut self.brake] {
            late.value += drag;
        }
    }

    /// What is taken off where a fresh run is predicted. Recordings in which the vehicle's speed hardly changes say
    /// nothing of its lateness: it is then taken to be the wheel's, so that a run in which it does change has its slip
    /// as recorded, and a guess moves no speed against the other.
    #[must_use]
    pub fn told(&self) -> Lateness {
        let apart = self.vehicle.value - self.wheel.value;
        let told = apart.abs() > LEAST_STDS_TOLD * self.vehicle.std;
        let wheel = self.late.wheel + self.late.wheel_by_turn;
        Lateness {
            vehicle: if told { self.late.vehicle } else { wheel },
            ..self.late
        }
    }

    /// Whether the wheel speed alone comes before the drag, and nothing shows a chain that would make it: a tyre does.
    fn wheel_early(&self, chain: Shown) -> bool {
        let others = self.vehicle.std < VAGUE_S
            && in_step(self.vehicle)
            && (in_step(self.brake) || self.brake.std > HEARD_S);
        let known = self.wheel.std < VAGUE_S;
        let least = least_left_s(chain.of_any, self.wheel.std);
        let before_all = self.wheel.value < self.vehicle.value.min(0.0) - least;
        !chain.of_wheel && others && known && before_all
    }

    /// Leaves the wheel speed as early as it is.
    fn leave_wheel(&mut self) {
        self.wheel_left = -self.wheel.value;
        self.late.wheel = 0.0;
        self.late.wheel_by_turn = 0.0;
        self.wheel.value = 0.0;
    }

    /// Whether the brake's reading comes before the torque does: by more than a filter or a logger out of step makes it,
    /// or by less where the speeds show that the loggers are in step.
    fn brake_early(&self) -> bool {
        let [wheel, vehicle] = [self.wheel, self.vehicle].map(|late| self.against_drag(late));
        let same_time =
            wheel.std < IN_STEP_S && in_step(wheel) && (in_step(vehicle) || vehicle.std > HEARD_S);
        let least = if same_time {
            LEAST_BRAKE_EARLY_IN_STEP_S
        } else {
            LEAST_BRAKE_EARLY_S
        };
        let Late { value, std } = self.brake;
        // One that is much earlier need not be known as well.
        let known = if std < VAGUE_S {
            0.0
        } else {
            UNKNOWN_STDS * std
        };
        value + known < -least
    }

    /// By how much the brake is read before its torque acts, as drag and wheel speed bear out alike: what both make of it is no
    /// lateness of the drag. Nothing where that is left to physics, or not known.
    #[must_use]
    pub fn brake_before_torque(&self) -> Option<Late> {
        let [wheel, brake] = [self.wheel, self.brake].map(|late| self.against_drag(late));
        let known = self.brake_heard && [wheel, brake].iter().all(|late| late.std < VAGUE_S);
        (known && !self.leaves_brake).then(|| Late {
            value: wheel.value.min(0.0) - brake.value,
            std: wheel.std.hypot(brake.std),
        })
    }

    /// Leaves the brake's reading as early as it is.
    fn leave_brake(&mut self) {
        self.leaves_brake = true;
        self.late.brake = 0.0;
        self.brake.value = 0.0;
    }

    /// Leaves the drag as late, the brake as early, or else the wheel speed as early, as they are to be explained, or as
    /// another's timing did; by how much the drag, and whether the brake.
    pub(super) fn leave_to_physics(
        &mut self,
        other: Option<&Self>,
        chain: Shown,
    ) -> (Option<f64>, bool) {
        let drag = other.map_or_else(
            || self.drag_late(chain.of_any),
            |other| (other.drag > 0.0).then_some(other.drag),
        );
        self.leave(drag.unwrap_or(0.0));
        let brake = other.map_or_else(|| self.brake_early(), |other| other.leaves_brake);
        let wheel = other.map_or_else(
            || drag.is_none() && !brake && self.wheel_early(chain),
            |other| other.wheel_left > 0.0,
        );
        if brake {
            self.leave_brake();
        }
        if wheel {
            self.leave_wheel();
        }
        self.unchained = other.map_or_else(
            || !chain.of_any && !chain.of_timing && self.all_in_step(),
            |other| other.unchained,
        );
        (drag, brake)
    }

    /// Whether a speed is known to be in step with the drag, as it was left, and nothing that is heard is not.
    fn all_in_step(&self) -> bool {
        let speeds = [self.wheel, self.vehicle];
        let mut heard = [self.wheel, self.vehicle, self.brake]
            .into_iter()
            .filter(|late| late.std < HEARD_S);
        speeds.iter().any(|late| late.std < VAGUE_S) && heard.all(in_step)
    }

    /// Whether a speed is surely out of step with the drag, as it was left.
    #[must_use]
    pub fn surely_out_of_step(&self) -> bool {
        let surely =
            |late: Late| late.std < HEARD_S && late.value.abs() > IN_STEP_S + SURE_DELAY * late.std;
        [self.wheel, self.vehicle].into_iter().any(surely)
    }

    /// What the timing does not tell of the chain.
    #[must_use]
    pub fn untold(&self) -> Untold {
        let known = |late: &Late| late.std < HEARD_S;
        let channels_s = [self.wheel, self.brake]
            .into_iter()
            .filter(known)
            .map(|late| late.value.abs() + UNKNOWN_STDS * late.std)
            .fold(0.0, f64::max);
        // A speed that hardly changes tells no lateness, and its own bends no slip.
        let wheel = Late {
            value: self.wheel.value - self.wheel_left,
            ..self.wheel
        };
        let drag_s = [wheel, self.vehicle]
            .into_iter()
            .filter(|late| late.std < VAGUE_S)
            .map(|late| UNKNOWN_STDS * late.std - self.against_drag(late).value)
            .fold(0.0, f64::max);
        // As found, for what is left to physics is early no more; against the drag as it is left.
        let brake_s = if self.brake_heard && self.brake.std < HEARD_S {
            UNKNOWN_STDS * self.brake.std - (self.found.brake + self.drag)
        } else {
            f64::INFINITY
        };
        Untold {
            channels_s,
            drag_s,
            brake_s,
            left: self.drag > 0.0 || self.wheel_left > 0.0 || self.unchained,
            unchained: self.unchained,
            by_turn: self.found.wheel_by_turn > SMALL_SHIFT_S,
        }
    }

    /// Takes over how late the channels are by shifts that are still asked for; a shift by a rate that is mostly noise
    /// says less than the audit does.
    pub(super) fn asked(&mut self, audit: &Audit, shift: [f64; 4], std: [f64; 3]) {
        let late = self.late;
        let value = |known: &Late, value: f64, std: f64| Late {
            value: within(known, value, std),
            std,
        };
        let wheel = late.wheel + late.wheel_by_turn + shift[0] + shift[3];
        self.wheel = value(&audit.wheel_late, wheel, std[0]);
        self.vehicle = value(&audit.vehicle_late, late.vehicle + shift[1], std[1]);
        self.brake = value(&audit.brake_late, late.brake + shift[2], std[2]);
    }

    /// Moves the channels by these shifts, as far as one pass may.
    pub(super) fn moved(&mut self, audit: &Audit, shift: [f64; 4]) {
        let step = |s: f64| {
            if s.is_finite() {
                s.clamp(-MOST_SHIFT_S, MOST_SHIFT_S)
            } else {
                0.0
            }
        };
        let late = &mut self.late;
        late.wheel += step(shift[0]);
        // A speed that hardly changes tells no lateness: each pass would shift it by as much as it may.
        if self.vehicle.std < MOST_SHIFT_S * PASSES as f64 {
            late.vehicle += step(shift[1]);
        }
        late.brake += step(shift[2]);
        // A ring's period delays, never hastens.
        late.wheel_by_turn = (late.wheel_by_turn + step(shift[3])).max(0.0);
        // What the audit knows is not given up for what a law, still wrong, would like.
        let by_turn = late.wheel_by_turn;
        let wheel = late.wheel + by_turn;
        late.wheel = within(&audit.wheel_late, wheel, self.wheel.std) - by_turn;
        late.vehicle = within(&audit.vehicle_late, late.vehicle, self.vehicle.std);
        late.brake = within(&audit.brake_late, late.brake, self.brake.std);
    }
}

/// A lateness fitted with this standard deviation, at most so many of the audit's from what that found; a vague one does not
/// hold a fit that knows it far better.
fn within(known: &Late, value: f64, std: f64) -> f64 {
    let reach = AUDIT_REACH * known.std;
    let holds = known.std < VAGUE_AUDIT_S || std > FAR_BETTER * known.std;
    if reach.is_finite() && holds {
        value.clamp(known.value - reach, known.value + reach)
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(wheel: f64, vehicle: f64, brake: f64) -> Timing {
        let late = |value| Late { value, std: 3e-4 };
        Timing {
            wheel: late(wheel),
            vehicle: late(vehicle),
            brake: late(brake),
            ..Timing::default()
        }
    }

    #[test]
    fn a_drag_that_all_channels_precede_alike_is_late_by_what_all_of_them_are_early() {
        let late = timing(-0.010, -0.011, -0.010).drag_late(false);
        assert!((late.unwrap() - 0.010).abs() < 1e-12);
        assert_eq!(timing(0.010, 0.011, 0.010).drag_late(false), None);
        // By little: loggers do that, where there are such.
        let little = timing(-0.0015, -0.0016, -0.0015);
        assert_eq!(little.drag_late(false), Some(0.0015));
        assert_eq!(little.drag_late(true), None);
        assert_eq!(timing(-0.0011, -0.0016, -0.0015).drag_late(false), None);
        // Each logger out of step by its own: what the others are early by beyond the wheel is theirs.
        assert_eq!(timing(-0.010, -0.013, -0.014).drag_late(false), Some(0.010));
        assert_eq!(timing(-0.010, -0.018, -0.019).drag_late(false), None);
    }

    #[test]
    fn a_vehicle_speed_that_is_late_speaks_against_a_late_drag_however_vague() {
        let mut no_brake = timing(-0.013, 0.032, 0.0);
        (no_brake.vehicle.std, no_brake.brake.std) = (0.003, 0.02);
        assert_eq!(no_brake.drag_late(false), None);
        // As vague as this it says nothing.
        no_brake.vehicle.std = 0.03;
        assert_eq!(no_brake.drag_late(false), Some(0.013));
    }

    #[test]
    fn a_wheel_that_is_early_alone_may_be_so_by_itself_where_a_chain_shows() {
        let mut alone = timing(-0.010, 0.0, 0.0);
        (alone.vehicle.std, alone.brake.std) = (0.03, f64::INFINITY);
        assert_eq!(alone.drag_late(false), Some(0.010));
        assert_eq!(alone.drag_late(true), None);
        // A brake that is early as well bears it out.
        (alone.brake.value, alone.brake.std) = (-0.010, 3e-4);
        assert_eq!(alone.drag_late(true), Some(0.010));
    }

    #[test]
    fn a_wheel_that_alone_precedes_drag_and_vehicle_is_left_to_the_tyre() {
        let mut early = timing(-0.004, 0.001, 0.0);
        let of_vehicle = Shown {
            of_any: true,
            ..Shown::default()
        };
        let of_wheel = Shown {
            of_wheel: true,
            ..of_vehicle
        };
        let early_by = |timing: Timing| timing.wheel_early(Shown::default());
        assert!(early_by(early.clone()) && early.wheel_early(of_vehicle));
        assert!(!early.wheel_early(of_wheel));
        let untold = early.untold();
        (early.late.wheel, early.late.wheel_by_turn) = (-0.005, 0.001);
        assert_eq!(
            early.leave_to_physics(None, Shown::default()),
            (None, false)
        );
        assert_eq!(early.wheel.value, 0.0);
        assert_eq!((early.late.wheel, early.late.wheel_by_turn), (0.0, 0.0));
        assert!(early.untold().left && !untold.left);
        // A tyre's memory is as long as before; the channels' is not.
        assert_eq!(early.untold().drag_s, untold.drag_s);
        assert!(early.untold().channels_s < 1e-3 && untold.channels_s > 4e-3);
        // By less than a logger is out of step unseen, or than is known, beside others that are early, or a vehicle's speed
        // that says nothing.
        let little = timing(-0.0015, 0.0, 0.0);
        assert!(early_by(little.clone()) && !little.wheel_early(of_vehicle));
        assert!(!early_by(timing(-0.0011, 0.0, 0.0)));
        assert!(!early_by(timing(-0.0015, -0.0011, 0.0)));
        assert!(!early_by(timing(-0.004, 0.005, 0.0)));
        assert!(!early_by(timing(-0.004, 0.0, 0.005)));
        let mut vague = timing(-0.004, 0.0, 0.0);
        vague.vehicle.std = 0.003;
        assert!(!early_by(vague));
        // Not alone: the brake is.
        let mut with_brake = timing(-0.004, 0.0, -0.025);
        assert_eq!(
            with_brake.leave_to_physics(None, Shown::default()),
            (None, true)
        );
        assert_eq!(with_brake.wheel.value, -0.004);
        // An argument by fewer runs does the same.
        let mut fewer = timing(-0.001, 0.005, 0.0);
        fewer.leave_to_physics(Some(&early), Shown::default());
        assert_eq!((fewer.wheel.value, fewer.vehicle.value), (0.0, 0.005));
    }

    #[test]
    fn a_late_receiver_says_nothing_against_a_late_drag() {
        assert_eq!(timing(-0.010, 0.030, -0.011).drag_late(false), Some(0.010));
        // Unless the drag's logger may be late, too.
        assert_eq!(timing(-0.010, 0.030, -0.011).drag_late(true), None);
        // A filter of the drag's that the brake has, too.
        assert_eq!(timing(-0.010, 0.030, 0.000).drag_late(false), None);
        assert_eq!(timing(0.004, 0.030, -0.011).drag_late(false), None);
        let mut no_brake = timing(-0.010, 0.030, 0.0);
        no_brake.brake.std = 0.02;
        assert_eq!(no_brake.drag_late(false), None);
    }

    #[test]
    fn a_brake_is_early_by_more_than_its_filters_make_it_where_that_is_known() {
        let early = |brake, std| {
            let mut told = timing(0.010, 0.030, brake);
            told.brake.std = std;
            told.brake_early()
        };
        assert!(early(-0.021, 1e-3) && !early(-0.019, 1e-3));
        // Three standard deviations beyond those 20 ms.
        assert!(early(-0.055, 5e-3) && !early(-0.034, 5e-3));
        assert!(!early(-0.055, f64::INFINITY));
    }

    #[test]
    fn a_memory_of_the_tyre_is_longer_than_what_it_leaves_to_a_late_drag() {
        // The drag 10 ms late against both speeds, whether or not it was left so: 3 standard deviations are 0.9 ms.
        let mut left = timing(-0.010, -0.010, -0.010);
        let taken_off = left.untold();
        assert!((taken_off.drag_s - 0.0109).abs() < 1e-9);
        left.leave(0.010);
        assert!((left.untold().drag_s - 0.0109).abs() < 1e-9);
        assert!((left.untold().channels_s - 9e-4).abs() < 1e-9);
        let shortest = taken_off.shortest_of_tyre_s();
        assert!((shortest - (taken_off.drag_s - shortest)).abs() < 1e-12);
        // Nor does a speed that hardly changes, whose lateness is not told.
        let mut held = timing(-0.001, 0.0, -0.001);
        held.vehicle.std = 7e-3;
        assert!((held.untold().drag_s - 0.0019).abs() < 1e-9);
        // Speeds that are late say nothing of the drag.
        assert!(timing(0.010, 0.030, 0.0).untold().drag_s < 1e-9);
    }

    #[test]
    fn a_lateness_that_is_hardly_told_sets_no_speed_surely_out_of_step() {
        let mut vague = timing(0.0, 0.018, 0.0);
        assert!(vague.surely_out_of_step());
        vague.vehicle.std = 0.004;
        assert!(!vague.surely_out_of_step() && !vague.all_in_step());
    }

    #[test]
    fn nothing_is_left_to_a_chain_that_neither_shows_nor_sets_a_channel_out_of_step() {
        let untold = |mut timing: Timing, of_any: bool| {
            let chain = Shown {
                of_any,
                ..Shown::default()
            };
            timing.leave_to_physics(None, chain);
            timing.untold()
        };
        let in_step = untold(timing(0.0005, -0.001, 0.0), false);
        assert!(in_step.left && in_step.unchained);
        let shows = untold(timing(0.0005, -0.001, 0.0), true);
        assert!(!shows.left && !shows.unchained);
        // A drag that is late for want of a chain is left in step with the others.
        assert!(untold(timing(-0.010, -0.010, -0.010), false).unchained);
        // A late receiver is one, and so is a logger that is behind.
        assert!(!untold(timing(0.0, 0.030, 0.0), false).unchained);
        assert!(!untold(timing(0.006, 0.0, 0.0), false).left);
        // However vaguely it is heard.
        let with_std = |std: f64| {
            let mut late = timing(0.0005, 0.030, 0.0);
            late.vehicle.std = std;
            late
        };
        assert!(!untold(with_std(0.003), false).unchained);
        // Of a speed that hardly changes nothing is known; of nothing that is known nothing follows.
        assert!(untold(with_std(0.02), false).unchained);
        let mut vague = with_std(0.02);
        vague.wheel.std = 0.003;
        assert!(!untold(vague, false).unchained);
        // One that the audit has late against another than the drag.
        let mut of_another = timing(0.0005, -0.001, 0.0);
        let of_timing = Shown {
            of_timing: true,
            ..Shown::default()
        };
        of_another.leave_to_physics(None, of_timing);
        assert!(!of_another.untold().unchained);
        // An argument by fewer runs does the same.
        let mut all = timing(0.0005, -0.001, 0.0);
        all.leave_to_physics(None, Shown::default());
        let mut fewer = timing(0.004, -0.001, 0.0);
        fewer.leave_to_physics(Some(&all), Shown::default());
        assert!(fewer.untold().unchained);
    }

    #[test]
    fn a_lateness_of_the_vehicle_that_is_not_told_from_the_wheels_is_the_wheels_on_a_fresh_run() {
        let mut timing = timing(0.010, -0.055, 0.0);
        timing.late = Lateness {
            wheel: 0.010,
            vehicle: -0.055,
            ..Lateness::default()
        };
        assert_eq!(timing.told(), timing.late);
        timing.vehicle.std = 0.09;
        assert_eq!((timing.told().wheel, timing.told().vehicle), (0.010, 0.010));
        // None, and surely so.
        timing.late.vehicle = 1e-4;
        timing.vehicle = Late {
            value: 1e-4,
            std: 5e-4,
        };
        assert_eq!((timing.told().wheel, timing.told().vehicle), (0.010, 1e-4));
    }

    #[test]
    fn a_brake_alone_that_is_read_early_says_nothing_of_the_drag() {
        let mut alone = timing(-0.02, -0.02, -0.035);
        (alone.wheel.std, alone.vehicle.std) = (0.01, f64::INFINITY);
        assert!(alone.drag_late(false).is_none() && alone.brake_early());
    }

    #[test]
    fn a_brake_read_a_little_early_is_the_brake_s_where_the_speeds_are_in_step() {
        assert!(timing(0.0005, -0.001, -0.008).brake_early());
        assert!(!timing(0.0005, -0.001, -0.004).brake_early(), "too little");
        // A logger out of step may be the brake's, too.
        assert!(!timing(0.006, -0.001, -0.008).brake_early());
        assert!(!timing(0.0005, 0.012, -0.008).brake_early());
        // Left late with the drag, the speeds are in step with nothing.
        let mut left = timing(-0.010, -0.010, -0.018);
        left.leave(0.010);
        assert!(!left.brake_early());
    }

    #[test]
    fn a_brake_is_read_before_its_torque_by_what_neither_drag_nor_wheel_shows() {
        let before = |wheel: f64, brake: f64| {
            let mut timing = timing(wheel, 0.02, brake);
            timing.brake_heard = true;
            timing.brake_before_torque().map(|late| late.value)
        };
        assert!((before(-0.004, -0.015).unwrap() - 0.011).abs() < 1e-12);
        assert!((before(0.003, -0.012).unwrap() - 0.012).abs() < 1e-12);
        assert!(
            before(-0.016, -0.014).unwrap() < 0.0,
            "the drag may be late"
        );
        let mut left = timing(0.0, 0.0, -0.03);
        assert!(left.brake_before_torque().is_none(), "not heard");
        left.brake_heard = true;
        left.leave_brake();
        assert!(left.brake_before_torque().is_none());
    }

    #[test]
    fn no_lag_of_the_brake_is_longer_than_its_reading_is_early() {
        let found = |wheel: f64, brake: f64| {
            let mut timing = timing(wheel, wheel, brake);
            timing.found = Lateness {
                wheel,
                vehicle: wheel,
                brake,
                ..Lateness::default()
            };
            timing.brake_heard = true;
            timing
        };
        // Three standard deviations are 0.9 ms.
        let mut early = found(0.0, -0.020);
        early.leave_brake();
        assert!((early.untold().brake_s - 0.0209).abs() < 1e-9);
        let mut late = found(0.0, 0.002);
        assert_eq!(late.untold().longest_of_brake_s(), 0.0);
        late.brake_heard = false;
        assert_eq!(late.untold().longest_of_brake_s(), f64::INFINITY);
        // Early with everything: the drag is late.
        let mut drag = found(-0.012, -0.012);
        drag.leave(0.012);
        assert!((drag.untold().brake_s - 9e-4).abs() < 1e-9);
    }

    #[test]
    fn an_argument_by_fewer_runs_leaves_what_the_one_by_all_runs_does() {
        let mut all = timing(-0.010, -0.011, -0.010);
        assert_eq!(
            all.leave_to_physics(None, Shown::default()),
            (Some(0.010), false)
        );
        // By itself it would give this to the chain.
        let mut fewer = timing(-0.010, -0.018, -0.019);
        assert_eq!(
            fewer.clone().leave_to_physics(None, Shown::default()),
            (None, false)
        );
        assert_eq!(
            fewer.leave_to_physics(Some(&all), Shown::default()),
            (Some(0.010), false)
        );
        assert!((fewer.wheel.value).abs() < 1e-12 && (fewer.vehicle.value + 0.008).abs() < 1e-12);
        // And this to the brake.
        let mut alone = timing(0.0, 0.0, -0.030);
        let mut late = timing(0.010, 0.011, 0.010);
        assert_eq!(late.leave_to_physics(None, Shown::default()), (None, false));
        assert_eq!(
            alone.leave_to_physics(Some(&late), Shown::default()),
            (None, false)
        );
        assert_eq!(alone.leave_to_physics(None, Shown::default()), (None, true));
    }

    #[test]
    fn a_delay_is_told_against_the_drag_as_recorded() {
        let mut timing = timing(-0.004, 0.03, -0.006);
        timing.leave(0.006);
        assert!((timing.vehicle.value - 0.036).abs() < 1e-12);
        assert!((timing.against_drag(timing.vehicle).value - 0.03).abs() < 1e-12);
    }

    #[test]
    fn a_vague_audit_holds_no_fit_that_knows_far_better() {
        let audit = |std: f64| Late { value: 0.037, std };
        assert!((within(&audit(0.001), 0.002, 4e-4) - 0.035).abs() < 1e-12);
        assert!((within(&audit(0.010), 0.002, 4e-4) - 0.002).abs() < 1e-12);
        // Neither knows: the audit, which has no law that may be wrong, is not given up.
        assert!((within(&audit(0.010), 0.002, 0.2) - 0.017).abs() < 1e-12);
        assert!((within(&audit(f64::INFINITY), 0.002, 0.2) - 0.002).abs() < 1e-12);
    }
}
