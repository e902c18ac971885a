//! Speed from pulses: count and period combined.
//!
//! Speed is whole pulses over the time between the first and the last of them, both stamped by a timer:
//!
//! ```text
//! ω = (2π / pulses a revolution) · pulses / (t_last - t_last_before)
//! ```
//!
//! so its resolution is that of the timer at any speed (the constant-elapsed-time method: R. Bonert, IEEE
//! Trans. Industrial Electronics 36 (1989); T. Ohmae et al., ibid. 29 (1982)). Between pulses the speed cannot
//! be more than one pulse over the time that has passed, which bounds it from above; with no pulse
//! for [`STANDSTILL_S`] it is zero.
//!
//! A pulse counts where it moves the wheel on: the first one after a change of direction only takes back the last. A
//! wheel that rocks on an edge counts up and down and captures an edge each time without turning; neither its count
//! nor its captures are motion, and the time since the last pulse that counted goes on.

use crate::board::EncoderReading;
use crate::number::nearest;
use crate::rates::Rates;
use muslip_record::EncoderParameters;

/// Time without a pulse after which an encoder stands still, in s.
pub const STANDSTILL_S: f32 = 0.25;

/// Edges up to the last rising one, from a counter in quadrature mode that counts both edges of channel A
/// and was preset odd where A was high.
///
/// An odd count then always means that A is high, whichever way it turns: its last edge rose. An even
/// count means that the edge before it, one step back, did. Both polarities together would measure the
/// encoder's duty as well as its speed.
#[inline]
pub fn rising_edges(count: u16, counts_down: bool) -> u16 {
    if count & 1 == 1 {
        count
    } else if counts_down {
        count.wrapping_add(1)
    } else {
        count.wrapping_sub(1)
    }
}

/// Speed of one encoder.
#[derive(Debug, Clone, Copy)]
pub struct SpeedMeter {
    radians_per_pulse: f32,
    tick_s: f32,
    standstill_ticks: u32,
    reversed: bool,
    /// Edges counted at the last sample.
    last_edges: Option<u16>,
    /// Time of the last pulse that counted.
    pulse_ticks: u32,
    /// Direction of the last pulse, counted or not.
    forward: bool,
    /// No pulse for [`STANDSTILL_S`], or none yet: the time of the last one means nothing.
    stands: bool,
    /// At the last pulse.
    measured_rad_s: f32,
    speed_rad_s: f32,
}

fn radians_per_pulse(encoder: &EncoderParameters) -> f32 {
    core::f32::consts::TAU / f32::from(encoder.pulses_per_revolution.max(1))
}

/// What an encoder says at one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speed {
    /// Speed in rad/s, positive forward.
    pub rad_s: f32,
    /// Speed in rad/s as measured at the last pulse.
    pub at_last_pulse_rad_s: f32,
    /// Time since the last pulse in s; [`STANDSTILL_S`] at standstill.
    pub age_s: f32,
    /// True where this sample brought a pulse.
    pub pulsed: bool,
}

impl SpeedMeter {
    /// At standstill.
    pub fn new(encoder: &EncoderParameters, rates: Rates) -> Self {
        Self {
            radians_per_pulse: radians_per_pulse(encoder),
            tick_s: rates.tick_s(),
            standstill_ticks: rates.edge_timer_hz() / 4,
            reversed: encoder.reversed,
            last_edges: None,
            pulse_ticks: 0,
            forward: true,
            stands: true,
            measured_rad_s: 0.0,
            speed_rad_s: 0.0,
        }
    }

    /// Takes an encoder's parameters; what was measured stays, in their units.
    pub fn take(&mut self, encoder: &EncoderParameters) {
        let before = *self;
        self.radians_per_pulse = radians_per_pulse(encoder);
        self.reversed = encoder.reversed;
        let ratio = self.radians_per_pulse / before.radians_per_pulse;
        let scale = if self.reversed == before.reversed {
            ratio
        } else {
            -ratio
        };
        self.measured_rad_s *= scale;
        self.speed_rad_s *= scale;
    }

    /// Takes the reading of the next sample.
    pub fn update(&mut self, reading: &EncoderReading) -> Speed {
        let edges = self.last_edges.replace(reading.edges);
        // Wraps rightly as long as fewer than 16,384 pulses come in a sample.
        let moved = reading
            .edges
            .wrapping_sub(edges.unwrap_or(reading.edges))
            .cast_signed()
            / 2;
        let pulses = self.counted(moved);
        let pulsed = pulses != 0;
        if edges.is_none() {
            self.pulse_ticks = reading.edge_ticks;
        }
        if pulsed {
            let period = reading.edge_ticks.wrapping_sub(self.pulse_ticks);
            self.pulse_ticks = reading.edge_ticks;
            if self.stands {
                // The first pulse after a standstill has no period.
                self.stands = false;
                self.measured_rad_s = 0.0;
            } else if period > 0 {
                let forward = if self.reversed {
                    -f32::from(pulses)
                } else {
                    f32::from(pulses)
                };
                self.measured_rad_s =
                    forward * self.radians_per_pulse / (nearest(period) * self.tick_s);
            }
            self.speed_rad_s = self.measured_rad_s;
        }
        let now_ticks = reading.edge_ticks.wrapping_add(reading.age_ticks);
        let age_ticks = now_ticks.wrapping_sub(self.pulse_ticks);
        if !pulsed && age_ticks >= self.standstill_ticks {
            self.stands = true;
        }
        if self.stands {
            self.speed_rad_s = 0.0;
            self.measured_rad_s = 0.0;
            return Speed {
                rad_s: 0.0,
                at_last_pulse_rad_s: 0.0,
                age_s: STANDSTILL_S,
                pulsed,
            };
        }
        let age_s = nearest(age_ticks) * self.tick_s;
        if !pulsed {
            let bound = self.radians_per_pulse / age_s.max(self.tick_s);
            // Not `clamp`, which panics where the bounds are not in order.
            self.speed_rad_s = self.speed_rad_s.min(bound).max(-bound);
        }
        Speed {
            rad_s: self.speed_rad_s,
            at_last_pulse_rad_s: self.measured_rad_s,
            age_s,
            pulsed,
        }
    }
}

impl SpeedMeter {
    /// Pulses that move the wheel on: all but the first after a change of direction.
    fn counted(&mut self, pulses: i16) -> i16 {
        let turned = pulses != 0 && (pulses > 0) != self.forward;
        if !turned {
            return pulses;
        }
        self.forward = pulses > 0;
        pulses - pulses.signum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EDGE_TIMER_HZ: u32 = 84_000_000;
    const RATES: Rates = Rates::new(1_000, EDGE_TIMER_HZ);
    const SAMPLE_S: f32 = RATES.sample_s();

    /// An encoder that turns at a given speed from a given phase, sampled at 1 kHz, its timer starting just
    /// before it wraps.
    struct Encoder {
        pulses_per_revolution: f64,
        pulses: f64,
        edge_s: f64,
        now_s: f64,
    }

    const START_TICKS: u32 = u32::MAX - 100_000;

    impl Encoder {
        fn new(pulses_per_revolution: u16) -> (Self, SpeedMeter) {
            let parameters = EncoderParameters {
                pulses_per_revolution,
                reversed: false,
            };
            let encoder = Self {
                pulses_per_revolution: f64::from(pulses_per_revolution),
                pulses: 0.3,
                edge_s: 0.0,
                now_s: 0.0,
            };
            (encoder, SpeedMeter::new(&parameters, RATES))
        }

        fn sample(&mut self, rad_s: f64) -> EncoderReading {
            let rate = rad_s / core::f64::consts::TAU * self.pulses_per_revolution;
            let end = self.pulses + rate * f64::from(SAMPLE_S);
            self.now_s += f64::from(SAMPLE_S);
            if end.floor() != self.pulses.floor() {
                let whole = if rate > 0.0 { end.floor() } else { end.ceil() };
                self.edge_s = self.now_s - (end - whole) / rate;
            }
            self.pulses = end;
            let ticks = |s: f64| (s * f64::from(EDGE_TIMER_HZ)).round() as u64 as u32;
            EncoderReading {
                edges: (self.pulses.floor() as i64 * 2 + 1) as u16,
                edge_ticks: START_TICKS.wrapping_add(ticks(self.edge_s)),
                age_ticks: ticks(self.now_s).wrapping_sub(ticks(self.edge_s)),
            }
        }
    }

    #[test]
    fn parameters_taken_while_it_turns_scale_the_speed_and_lose_no_pulse() {
        for (pulses_per_revolution, reversed, scale) in
            [(500, false, 1.0), (250, false, 2.0), (500, true, -1.0)]
        {
            let (mut encoder, mut meter) = Encoder::new(500);
            for _ in 0..100 {
                meter.update(&encoder.sample(65.0));
            }
            meter.take(&EncoderParameters {
                pulses_per_revolution,
                reversed,
            });
            for _ in 0..100 {
                let speed = meter.update(&encoder.sample(65.0)).rad_s;
                assert!(
                    (f64::from(speed) / (65.0 * scale) - 1.0).abs() < 5e-5,
                    "{speed}"
                );
            }
        }
    }

    #[test]
    fn parameters_taken_between_two_pulses_scale_the_speed_at_once() {
        for (pulses_per_revolution, reversed, scale) in
            [(500, false, 1.0), (250, false, 2.0), (250, true, -2.0)]
        {
            // A pulse every twelfth sample or so.
            let (mut encoder, mut meter) = Encoder::new(500);
            while !meter.update(&encoder.sample(1.0)).pulsed || encoder.now_s < 1.0 {}
            meter.take(&EncoderParameters {
                pulses_per_revolution,
                reversed,
            });
            let speed = meter.update(&encoder.sample(1.0));
            assert!(!speed.pulsed);
            for rad_s in [speed.rad_s, speed.at_last_pulse_rad_s] {
                assert!((rad_s - scale).abs() < 1e-3, "{rad_s} {scale}");
            }
        }
    }

    #[test]
    fn speed_is_as_fine_at_low_speed_as_at_high_speed_and_across_both_wraps() {
        for pulses_per_revolution in [48, 500, 4096] {
            for rad_s in [1.0, 3.3, 65.0, 140.0] {
                let (mut encoder, mut meter) = Encoder::new(pulses_per_revolution);
                let settle = (2.2 * core::f64::consts::TAU / rad_s * 1000.0
                    / f64::from(pulses_per_revolution)) as usize
                    + 2;
                for index in 0..4000 {
                    let speed = meter.update(&encoder.sample(rad_s));
                    if index > settle {
                        let error = f64::from(speed.rad_s) / rad_s - 1.0;
                        assert!(
                            error.abs() < 5e-5,
                            "{pulses_per_revolution} {rad_s} {error}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn without_pulses_speed_falls_and_ends_at_standstill_for_good() {
        let (mut encoder, mut meter) = Encoder::new(500);
        for _ in 0..100 {
            meter.update(&encoder.sample(60.0));
        }
        let mut last = 60.1;
        for index in 0..60_000 {
            let speed = meter.update(&encoder.sample(0.0));
            assert!(speed.rad_s <= last && !speed.pulsed);
            // One pulse over the time passed, and zero from the time-out on: also when the timer has
            // come round (51 s) and the age reads small again.
            let passed = (f64::from(index) + 1.0) * 1e-3;
            assert!(
                f64::from(speed.rad_s) <= 0.012_57 / passed,
                "{passed} {}",
                speed.rad_s
            );
            assert!(passed < 0.26 || speed.rad_s == 0.0, "{passed}");
            last = speed.rad_s;
        }
        // Again in motion: the first pulse has no period, the second has the right one.
        let mut speeds = [0.0; 20];
        for speed in &mut speeds {
            *speed = meter.update(&encoder.sample(60.0)).rad_s;
        }
        assert_eq!(speeds[0], 0.0);
        assert!((speeds[2] - 60.0).abs() < 0.01, "{speeds:?}");
    }

    #[test]
    fn backwards_is_negative_and_a_reversed_encoder_turns_it_round() {
        let (mut encoder, mut meter) = Encoder::new(500);
        let mut reversed = SpeedMeter::new(
            &EncoderParameters {
                pulses_per_revolution: 500,
                reversed: true,
            },
            RATES,
        );
        let mut speeds = (0.0, 0.0);
        for _ in 0..50 {
            let reading = encoder.sample(-20.0);
            speeds = (
                meter.update(&reading).rad_s,
                reversed.update(&reading).rad_s,
            );
        }
        assert!((speeds.0 + 20.0).abs() < 1e-2, "{speeds:?}");
        assert_eq!(speeds.0, -speeds.1);
    }

    #[test]
    fn the_last_rising_edge_is_found_from_a_count_of_both_edges_in_both_directions() {
        // Forward: low 0, rise 1, fall 2, rise 3. The rising edges are 1 and 3.
        assert_eq!([1, 2, 3, 4].map(|c| rising_edges(c, false)), [1, 1, 3, 3]);
        // Backward from high 3: fall 2, rise 1, fall 0.
        assert_eq!([3, 2, 1, 0].map(|c| rising_edges(c, true)), [3, 3, 1, 1]);
        assert_eq!(rising_edges(0, false), u16::MAX);
    }

    /// Both channels of an encoder at the edges' instants, with the timers as they are set up: one counts A's edges by
    /// B's level, one captures A's rise.
    struct Timers {
        duty: f64,
        high: bool,
        count: u16,
        down: bool,
        edge_ticks: u32,
        now_s: f64,
    }

    /// Steps of a sample: finer than any edge here.
    const STEPS: u32 = 200;

    impl Timers {
        fn new(duty: f64, pulses: f64) -> Self {
            let high = pulses.rem_euclid(1.0) < duty;
            Self {
                duty,
                high,
                count: u16::from(high),
                down: false,
                edge_ticks: 0,
                now_s: 0.0,
            }
        }

        /// A sample over which the position in pulses is this function of the time in s.
        fn sample(&mut self, position: impl Fn(f64) -> f64) -> EncoderReading {
            let ticks = |s: f64| (s * f64::from(EDGE_TIMER_HZ)).round() as u64 as u32;
            for _ in 0..STEPS {
                self.now_s += f64::from(SAMPLE_S) / f64::from(STEPS);
                let pulses = position(self.now_s);
                let high = pulses.rem_euclid(1.0) < self.duty;
                let b = (pulses - 0.25).rem_euclid(1.0) < 0.5;
                if high != self.high {
                    // RM0090, table 96: a rise with the other channel low counts up, with it high down.
                    self.down = high == b;
                    self.count = if self.down {
                        self.count.wrapping_sub(1)
                    } else {
                        self.count.wrapping_add(1)
                    };
                    if high {
                        self.edge_ticks = ticks(self.now_s);
                    }
                    self.high = high;
                }
            }
            EncoderReading {
                edges: rising_edges(self.count, self.down),
                edge_ticks: self.edge_ticks,
                age_ticks: ticks(self.now_s).wrapping_sub(self.edge_ticks),
            }
        }
    }

    const RINGS: [u16; 4] = [12, 24, 48, 500];
    const DUTIES: [f64; 3] = [0.3, 0.5, 0.7];

    fn meter(pulses_per_revolution: u16) -> SpeedMeter {
        SpeedMeter::new(
            &EncoderParameters {
                pulses_per_revolution,
                reversed: false,
            },
            RATES,
        )
    }

    #[test]
    fn a_wheel_that_rocks_on_an_edge_stands_at_every_phase() {
        for ring in RINGS {
            for duty in DUTIES {
                for phase in 0..20 {
                    // Rolls at 60 rad/s, then stops at this phase and shakes by this many pulses at this rate.
                    for (shake, hertz) in [(0.1, 330.0), (0.4, 90.0), (0.9, 35.0)] {
                        let rate = 60.0 / core::f64::consts::TAU * f64::from(ring);
                        let stop = (rate * 0.2).floor() + f64::from(phase) / 20.0;
                        let position = |s: f64| {
                            let rolled = (rate * s).min(stop);
                            let shakes = rate * s > stop;
                            let angle = core::f64::consts::TAU * hertz * s;
                            rolled + f64::from(u8::from(shakes)) * 0.5 * shake * angle.sin()
                        };
                        let (mut timers, mut meter) = (Timers::new(duty, 0.0), meter(ring));
                        for sample in 0..600 {
                            let speed = meter.update(&timers.sample(position));
                            // 0.2 s of rolling, a pulse for the last edges, then the standstill's time.
                            if sample > 200 + 250 + 12 {
                                assert_eq!(
                                    speed.rad_s, 0.0,
                                    "{ring} pulses, duty {duty}, phase {phase}, shake {shake}, {sample}"
                                );
                                assert!(speed.age_s >= STANDSTILL_S);
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_duty_of_channel_a_does_not_show_in_the_speed_either_way() {
        for ring in RINGS {
            for duty in DUTIES {
                for rad_s in [35.0, -35.0] {
                    let rate = rad_s / core::f64::consts::TAU * f64::from(ring);
                    let (mut timers, mut meter) = (Timers::new(duty, 0.1), meter(ring));
                    for sample in 0..400 {
                        let speed = meter.update(&timers.sample(|s| 0.1 + rate * s));
                        let error = f64::from(speed.rad_s) / rad_s - 1.0;
                        // The simulation's steps are 5 us.
                        let share = 5e-6 * rate.abs() + 1e-4;
                        assert!(sample < 60 || error.abs() < share, "{ring} {duty} {error}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_reversal_is_followed_and_never_read_as_faster_than_it_is() {
        for ring in RINGS {
            for duty in DUTIES {
                for phase in 0..20 {
                    let rate = 20.0 / core::f64::consts::TAU * f64::from(ring);
                    let turn = 0.3 + f64::from(phase) / 20.0 / rate;
                    let position = |s: f64| rate * (s.min(turn) - (s - turn).max(0.0));
                    let (mut timers, mut meter) = (Timers::new(duty, 0.0), meter(ring));
                    let mut speed = 0.0;
                    for _ in 0..600 {
                        speed = meter.update(&timers.sample(position)).rad_s;
                        assert!(speed.abs() < 20.4, "{ring} {duty} {phase}: {speed}");
                    }
                    assert!((speed + 20.0).abs() < 0.4, "{ring} {duty} {phase}: {speed}");
                }
            }
        }
    }

    #[test]
    fn a_lost_channel_b_reads_as_no_pulses() {
        // Counts forth and back on each pulse of A, whose captures go on.
        let mut meter = meter(500);
        let mut speed = 0.0;
        for sample in 0..600_u32 {
            let ticks = sample * (EDGE_TIMER_HZ / 1000);
            let lost = sample >= 200;
            speed = meter
                .update(&EncoderReading {
                    edges: if lost { 1_601 } else { (8 * sample + 1) as u16 },
                    edge_ticks: ticks,
                    age_ticks: 100,
                })
                .rad_s;
            if sample == 190 {
                assert!(speed > 40.0, "{speed}");
            }
        }
        assert_eq!(speed, 0.0);
    }
}
