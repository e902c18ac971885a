//! The oracle: the truth itself, driven with the measured, noisy inputs of a run.
//!
//! It knows every concealed effect and every figure, the wear at the start of the run and the
//! wheel's angle; it does not know the inputs' noise. Its mean squared error against the load
//! cell's reading without random noise is the floor that no model driven sample by sample with
//! these inputs can be expected to beat. `best` lets it smooth its inputs by centred means.

use crate::generate::chain::Readings;
use crate::generate::chain::{Chain, at, ripple};
use crate::generate::effect::{Effect, Scale};
use crate::generate::form::Form;
use crate::generate::instrument::Instruments;
use crate::generate::measure::{filled, rms, usable};
use crate::generate::noise::Written;
use crate::generate::rig::Rig;
use crate::generate::sim::Stretch;
use crate::generate::tyre::{Contact, Tyre, Wear};

/// What the oracle is told.
pub struct Oracle<'a> {
    pub rig: &'a Rig,
    pub effects: &'a [Effect],
    pub scale: Scale,
    pub run: usize,
    pub clock: f64,
    pub angle: f64,
    pub wear: Wear,
    pub instruments: &'a Instruments,
}

/// Mean squared errors of the oracle, N².
#[derive(Clone, Copy, Debug)]
pub struct Floor {
    pub raw: f64,
    pub best: f64,
}

impl Oracle<'_> {
    /// The floor of a run: against the load cell's `reading` without random noise, at samples that are usable.
    pub fn floor(&self, clean: &Readings, reading: &[f64], written: &Written) -> Floor {
        let error = |width: usize| {
            let predicted = self.predict(written, width);
            let errors: Vec<f64> = (0..clean.time.len())
                .filter(|&i| usable(self.rig, clean, i))
                .map(|i| reading[i] - predicted[i])
                .collect();
            rms(errors.iter()).powi(2)
        };
        let raw = error(1);
        let best = [3, 5, 9, 17, 33].into_iter().map(error).fold(raw, f64::min);
        Floor { raw, best }
    }

    /// The reading that the truth expects from what was written, inputs smoothed over `width` samples.
    pub fn predict(&self, written: &Written, width: usize) -> Vec<f64> {
        let mut out = Vec::with_capacity(written.time.len());
        let mut from = 0;
        for to in 1..=written.time.len() {
            let gap = to == written.time.len()
                || written.time[to] - written.time[to - 1] > 8.0 / self.rig.rate_hz;
            if gap {
                out.extend(self.stretch(written, from, to, width));
                from = to;
            }
        }
        out
    }

    fn stretch(&self, written: &Written, from: usize, to: usize, width: usize) -> Vec<f64> {
        let times = &written.time[from..to];
        let input = |values: &[f64]| smooth(&filled(values)[from..to], width);
        let (wheel, mut speed, load, column) = (
            input(&written.wheel),
            input(&written.speed),
            input(&written.load),
            input(&written.column),
        );
        for effect in self.effects {
            if effect.form == Form::OutSpeedBand {
                for value in &mut speed {
                    *value /=
                        1.0 + effect.a * (-((*value - effect.p[0]) / effect.p[1]).powi(2)).exp();
                }
            }
        }
        let substeps = (4000.0 / self.rig.rate_hz).ceil().max(4.0) as usize;
        let period = 1.0 / self.rig.rate_hz;
        let dt = period / substeps as f64;
        let points = (times.len() - 1) * substeps + 1;
        let mut tyre = Tyre::new(
            self.effects,
            self.scale,
            (self.rig.peak_friction, self.rig.critical_slip),
            self.run,
            self.wear,
        );
        // What the instruments and the concealed effects make late is taken back, as if known.
        let spin = (wheel.iter().sum::<f64>() / wheel.len().max(1) as f64)
            .max(0.1 * self.rig.mean_speed_m_s / self.rig.radius_m);
        let [wheel_late, speed_late, drag_late, load_late, _] = self.instruments.delays(spin);
        let effect_late = |forms: [Form; 2]| -> f64 {
            let late = |effect: &&Effect| forms.contains(&effect.form);
            self.effects.iter().filter(late).map(|effect| effect.a).sum()
        };
        let wheel_late =
            (wheel_late + effect_late([Form::WheelLate, Form::WheelLateWindow])) / period;
        let speed_late =
            (speed_late + effect_late([Form::VehicleLate, Form::VehicleLateHeld])) / period;
        let load_late = load_late / period;
        let mut stretch = Stretch {
            start: times[0],
            dt,
            ..Stretch::default()
        };
        let (mut angle, mut distance) = (self.angle, 0.0);
        for point in 0..points {
            let place = point as f64 / substeps as f64;
            let mut wheel_now = at(&wheel, place + wheel_late);
            for effect in self.effects {
                if matches!(effect.form, Form::RippleSine | Form::RippleTiming) {
                    wheel_now /= ripple(effect, angle);
                }
            }
            let speed_now = at(&speed, place + speed_late);
            let step = if point == 0 { 0.0 } else { dt };
            angle += wheel_now * step;
            distance += speed_now * step;
            let contact = Contact {
                time: stretch.start + point as f64 * dt,
                speed: speed_now,
                wheel: wheel_now,
                load: at(&load, place + load_late),
                angle,
                distance,
                column: at(&column, place),
            };
            let drag = tyre.advance(step, &contact);
            stretch.speed.push(speed_now);
            stretch.wheel.push(wheel_now);
            stretch.load.push(contact.load);
            stretch.drag.push(drag);
            stretch.column.push(contact.column);
        }
        // Under a drift of the whole campaign the written time is the campaign's clock already.
        let drifting = self
            .effects
            .iter()
            .any(|effect| effect.form == Form::DriftClock);
        let chain = Chain {
            effects: self.effects,
            scale: self.scale,
            run: self.run,
            clock: if drifting { 0.0 } else { self.clock },
        };
        let reading = chain.drag(&stretch);
        (0..times.len())
            .map(|i| {
                self.instruments.drag.zero
                    + at(&reading, (i * substeps) as f64 - drag_late / dt)
            })
            .collect()
    }
}

/// Centred mean over an odd number of samples, shorter at the ends.
fn smooth(values: &[f64], width: usize) -> Vec<f64> {
    let half = width / 2;
    (0..values.len())
        .map(|i| {
            let reach = half.min(i).min(values.len() - 1 - i);
            let window = &values[i - reach..=i + reach];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}
