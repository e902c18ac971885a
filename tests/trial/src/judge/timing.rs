//! When each channel tells what happened: what real chains make of delays, and whether an answer says so.
//!
//! The contract states a delay against the analogue channels. A concealed delay adds to that of the chain, so the true
//! figure is the sum, and a chain may cancel what was concealed. Effects that a chain has as well are judged apart.

use serde::Serialize;
use serde_json::Value;

use crate::contract::{list, number, text};
use crate::generate::campaign::Truth;
use crate::generate::instrument::ChainKind;
use crate::judge::names::{Standing, standing};

/// Names of what a chain does as well.
pub const OF_THE_CHAIN: [&str; 5] = [
    "vehicle_speed_delay",
    "wheel_speed_delay",
    "force_delay",
    "force_lag",
    "encoder_ripple",
];

/// What a time may be off by, whatever its size, s; and any value relative to itself.
pub const TIME_SLACK_S: f64 = 2e-3;
pub const RELATIVE_SLACK: f64 = 0.2;

/// A net delay that `chain` is asked for, s.
const ASKED_S: f64 = 5e-3;

const SPEEDS: [&str; 2] = ["vehicle_speed_m_s", "wheel_speed_rad_s"];
const DRAG: &str = "drag_force_n";

/// Mean delays of the channels, s.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    wheel: f64,
    vehicle: f64,
    drag: f64,
    load: f64,
    brake: f64,
}

impl Timing {
    /// Of the measuring chain alone. A sensor whose delay depends on speed counts at four fifths of the mean, as where
    /// the generator says which names a chain makes true.
    pub fn of_chain(truth: &Truth) -> Timing {
        let spin = 0.8 * truth.rig.mean_speed_m_s / truth.rig.radius_m;
        let [wheel, vehicle, drag, load, brake] = truth.instruments.delays(spin);
        Timing {
            wheel,
            vehicle,
            drag,
            load,
            brake,
        }
    }

    /// Of the chain and of concealed delays together.
    pub fn of(truth: &Truth) -> Timing {
        let mut timing = Timing::of_chain(truth);
        for concealed in &truth.concealed {
            let late = match concealed.effect.id.as_str() {
                "vehicle_speed_delay" => &mut timing.vehicle,
                "wheel_speed_delay" => &mut timing.wheel,
                "force_delay" => &mut timing.drag,
                _ => continue,
            };
            *late += concealed
                .figures
                .iter()
                .find(|figure| figure.name == "delay")
                .and_then(|figure| figure.values.first())
                .copied()
                .unwrap_or(0.0);
        }
        timing
    }

    fn of_channel(&self, channel: &str) -> Option<f64> {
        match channel {
            "wheel_speed_rad_s" => Some(self.wheel),
            "vehicle_speed_m_s" => Some(self.vehicle),
            DRAG => Some(self.drag),
            "normal_force_n" => Some(self.load),
            "brake_torque_nm" | "brake_pressure_pa" => Some(self.brake),
            _ => None,
        }
    }

    /// By how much a channel is later than another; than the drag where none is named.
    pub fn net(&self, channel: &str, relative_to: &str) -> Option<f64> {
        let other = if relative_to.is_empty() {
            DRAG
        } else {
            relative_to
        };
        Some(self.of_channel(channel)? - self.of_channel(other)?)
    }

    /// What the chain adds to the figure `delay` of a mechanism. A speed's is against the drag. The drag's own is against
    /// the later of both speeds: what one of them alone is early by is that channel's, not the load cell's.
    pub fn added(&self, mechanism: &str) -> f64 {
        match mechanism {
            "vehicle_speed_delay" => self.vehicle - self.drag,
            "wheel_speed_delay" => self.wheel - self.drag,
            "force_delay" => self.drag - self.wheel.max(self.vehicle),
            _ => 0.0,
        }
    }
}

/// Whether a time is told well enough.
pub fn close(value: f64, truth: f64) -> bool {
    (value - truth).abs() <= TIME_SLACK_S.max(RELATIVE_SLACK * truth.abs())
}

/// An entry of `chain` on the timing of a channel, as a statement about that channel.
#[derive(Clone, Copy, Debug)]
pub struct Said {
    pub value: f64,
    pub std: f64,
    /// What is true against the channel that the entry refers to.
    pub net: f64,
    /// Of all runs together.
    pub of_all: bool,
}

/// What `chain` says of a channel's lateness, the same said of the other channel turned round.
pub fn said(diagnosis: &Value, timing: &Timing, channel: &str) -> Vec<Said> {
    list(diagnosis, "chain")
        .iter()
        .filter(|entry| text(entry, "finding") == "late")
        .filter_map(|entry| {
            let (own, other) = (text(entry, "channel"), text(entry, "relative_to"));
            let (sign, other) = if own == channel {
                (1.0, other)
            } else if other == channel {
                (-1.0, own)
            } else {
                return None;
            };
            Some(Said {
                value: sign * number(entry, "value"),
                std: number(entry, "std"),
                net: timing.net(channel, other)?,
                of_all: matches!(text(entry, "recording"), "*" | ""),
            })
        })
        .collect()
}

/// A speed channel of a real chain that is later or earlier than the drag, and whether `chain` says so.
#[derive(Clone, Debug, Serialize)]
pub struct LateCase {
    pub channel: String,
    /// Against the drag, s.
    pub net: f64,
    /// Whether the recordings can show it: the speed of a vehicle that is driven hardly changes.
    pub shown: bool,
    /// Reported value and standard deviation, and what they should be: against the channel that the entry names.
    pub reported: Option<(f64, f64, f64)>,
    pub right: bool,
    /// The truth within two of the reported standard deviations; none where nothing is reported.
    pub covered: Option<bool>,
}

/// The speed channels that `chain` is asked for.
pub fn late(truth: &Truth, diagnosis: &Value) -> Vec<LateCase> {
    // Where something delays the drag itself, what the analogue channels show is not one time.
    let blurred = truth.concealed.iter().any(|concealed| {
        matches!(
            concealed.effect.id.as_str(),
            "force_delay" | "force_lag" | "relaxation_length" | "structural_resonance"
        )
    });
    if truth.instruments.kind != ChainKind::Real || blurred {
        return Vec::new();
    }
    let timing = Timing::of(truth);
    SPEEDS
        .iter()
        .filter_map(|channel| Some((channel, timing.net(channel, "")?)))
        .filter(|(_, net)| net.abs() >= ASKED_S)
        .map(|(channel, net)| {
            // That two channels are in step says nothing of either against the others.
            let said: Vec<Said> = said(diagnosis, &timing, channel)
                .into_iter()
                .filter(|said| said.net.abs() >= ASKED_S)
                .collect();
            let told = said.iter().find(|said| said.of_all).or(said.first());
            LateCase {
                channel: (*channel).to_owned(),
                net,
                shown: *channel != SPEEDS[0] || truth.rig.coasting,
                reported: told.map(|told| (told.value, told.std, told.net)),
                right: said.iter().any(|said| close(said.value, said.net)),
                covered: told.map(|told| (told.value - told.net).abs() <= 2.0 * told.std),
            }
        })
        .collect()
}

/// Whether the one concealed effect is of a sort that the real chain before it has as well.
pub fn of_the_chain(truth: &Truth) -> bool {
    truth.stratum == "single"
        && truth.instruments.kind == ChainKind::Real
        && matches!(truth.concealed.as_slice(), [only] if OF_THE_CHAIN.contains(&only.effect.id.as_str()))
}

/// Of such a campaign: whether the net delay is told, by the mechanism or by `chain`; a lag or a ripple named at all. Where
/// the chain cancels the delay to within what a time may be off by, silence is right.
pub fn right(truth: &Truth, diagnosis: &Value) -> Option<bool> {
    let [concealed] = truth.concealed.as_slice() else {
        return None;
    };
    if !of_the_chain(truth) {
        return None;
    }
    let id = concealed.effect.id.as_str();
    let accepted: Vec<&Value> = list(diagnosis, "mechanisms")
        .iter()
        .filter(|named| standing(truth, text(named, "id")) == Standing::Accepted)
        .collect();
    let found = |channel: &str, word: &str| {
        list(diagnosis, "chain")
            .iter()
            .any(|entry| text(entry, "channel") == channel && text(entry, "finding") == word)
    };
    let channel = match id {
        "encoder_ripple" => return Some(!accepted.is_empty() || found(SPEEDS[1], "ripple")),
        "force_lag" => return Some(!accepted.is_empty() || found(DRAG, "low_passed")),
        "vehicle_speed_delay" => SPEEDS[0],
        "wheel_speed_delay" => SPEEDS[1],
        _ => DRAG,
    };
    let concealed_s = concealed
        .figures
        .iter()
        .find(|figure| figure.name == "delay")
        .and_then(|figure| figure.values.first())?;
    let net = concealed_s + Timing::of_chain(truth).added(id);
    let named: Vec<f64> = accepted
        .iter()
        .flat_map(|named| list(named, "parameters"))
        .filter(|parameter| matches!(text(parameter, "name"), "delay" | "time_constant"))
        .map(|parameter| number(parameter, "value"))
        .collect();
    let timing = Timing::of(truth);
    let mut said = said(diagnosis, &timing, channel);
    if channel == DRAG {
        // Where the analogue channels are the late ones, the speeds come out early.
        said.extend(
            SPEEDS
                .iter()
                .flat_map(|speed| self::said(diagnosis, &timing, speed)),
        );
    }
    if named.is_empty() && said.is_empty() {
        return Some(net.abs() <= TIME_SLACK_S);
    }
    Some(
        named.iter().any(|value| close(*value, net))
            || said
                .iter()
                .any(|said| said.net.abs() > TIME_SLACK_S && close(said.value, said.net)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::family::toy;
    use serde_json::json;

    /// A concealed delay of 30 ms through a chain whose drag is 10 ms late, vehicle speed 50 and wheel speed 5.
    fn through_a_chain(id: &str) -> Truth {
        let mut truth = toy::truth("single", id, "delay", 0.03);
        truth.instruments.kind = ChainKind::Real;
        // One pole in every card: the drag is as late as its time constant.
        for card in [
            &mut truth.instruments.drag,
            &mut truth.instruments.load,
            &mut truth.instruments.brake,
        ] {
            (card.pole_s, card.poles) = (0.010, 1);
        }
        truth.instruments.vehicle_late_s = 0.050;
        truth.instruments.wheel_late_s = 0.005;
        truth
    }

    fn names(id: &str, value: f64) -> Value {
        json!({"mechanisms": [{"id": id, "parameters": [{"name": "delay", "value": value}]}]})
    }

    fn finds(channel: &str, relative_to: &str, value: f64) -> Value {
        json!({"chain": [{"recording": "*", "channel": channel, "relative_to": relative_to, "finding": "late",
            "value": value, "std": 0.001}]})
    }

    #[test]
    fn a_delay_through_a_chain_is_the_sum() {
        let net = |id: &str| 0.03 + Timing::of_chain(&through_a_chain(id)).added(id);
        assert!((net("vehicle_speed_delay") - 0.07).abs() < 1e-12);
        assert!((net("wheel_speed_delay") - 0.025).abs() < 1e-12);
        // The vehicle's speed is later than the drag: the load cell's own delay does not show.
        assert!((net("force_delay") + 0.01).abs() < 1e-12);
        assert_eq!(
            Timing::of_chain(&through_a_chain("force_lag")).added("force_lag"),
            0.0
        );
    }

    #[test]
    fn effects_that_a_chain_has_too_are_right_by_their_net_delay() {
        let truth = through_a_chain("vehicle_speed_delay");
        let vehicle = "vehicle_speed_m_s";
        assert!(of_the_chain(&truth));
        let verdict = |diagnosis: &Value| right(&truth, diagnosis).unwrap();
        assert!(verdict(&names("vehicle_speed_delay", 0.06)));
        assert!(!verdict(&names("vehicle_speed_delay", 0.03)));
        assert!(!verdict(&names("wheel_speed_delay", 0.07)));
        assert!(verdict(&finds(vehicle, "", 0.07)));
        // Against the wheel speed it is 75 ms; the wheel speed against it the same with another sign.
        assert!(verdict(&finds(vehicle, "wheel_speed_rad_s", 0.075)));
        assert!(verdict(&finds("wheel_speed_rad_s", vehicle, -0.075)));
        assert!(!verdict(&finds("wheel_speed_rad_s", vehicle, 0.075)));
        assert!(!verdict(&json!({})));

        let mut cancelled = through_a_chain("vehicle_speed_delay");
        cancelled.instruments.vehicle_late_s = -0.0195;
        assert_eq!(right(&cancelled, &json!({})), Some(true));
        let lag = through_a_chain("force_lag");
        assert_eq!(right(&lag, &names("force_lag", 9.0)), Some(true));
        assert_eq!(right(&lag, &json!({})), Some(false));

        let mut ideal = truth.clone();
        ideal.instruments.kind = ChainKind::Ideal;
        assert!(!of_the_chain(&ideal) && right(&ideal, &json!({})).is_none());
        assert!(!of_the_chain(&through_a_chain("run_out")));
    }

    #[test]
    fn a_late_speed_of_a_chain_is_asked_for() {
        let mut truth = through_a_chain("run_out");
        let vehicle = "vehicle_speed_m_s";
        // Without a word, then in step with nothing, then well told.
        let told = late(&truth, &json!({}));
        assert_eq!(told.len(), 2, "the wheel speed is 5 ms early");
        assert!(
            told.iter()
                .all(|case| !case.right && case.covered.is_none())
        );
        let told = late(&truth, &finds(vehicle, "", 0.047));
        assert_eq!((told[0].right, told[0].covered), (true, Some(false)));
        let told = late(&truth, &finds(vehicle, "", 0.0385));
        assert!((told[0].net - 0.04).abs() < 1e-12);
        assert_eq!((told[0].right, told[0].covered), (true, Some(true)));
        assert!(!late(&truth, &finds(vehicle, "", 0.02))[0].right);
        // One entry a run: any of them.
        let mut several = finds(vehicle, "", 0.02);
        several["chain"].as_array_mut().unwrap().extend(
            finds(vehicle, "", 0.04)["chain"]
                .as_array()
                .unwrap()
                .clone(),
        );
        assert!(late(&truth, &several)[0].right);
        truth.concealed = through_a_chain("force_delay").concealed;
        assert!(late(&truth, &json!({})).is_empty());
    }
}
