//! What wheel and vehicle lack without one of their mechanisms, sample by sample: the picture of its effect.

use crate::campaign::Run;
use crate::mechanism::{Against, Balance};
use crate::model::{Model, vehicle, wheel};
use crate::repaired::{Repaired, RepairedError, Which};
use crate::series::Series;

/// The channel that an effect is drawn over.
fn channel(against: Against, series: &Series) -> &[f64] {
    match against {
        Against::Time => &series.time,
        Against::VehicleSpeed => &series.speed.smooth,
        Against::WheelSpeed => &series.wheel.smooth,
        Against::NormalForce => &series.load.smooth,
        Against::Drag => &series.drag_smooth,
        Against::VehicleAcceleration => &series.speed.rate,
        Against::WheelAcceleration => &series.wheel.rate,
    }
}

/// An instant of a balance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Time in s.
    pub time_s: f64,
    /// What the effect is a function of.
    pub at: f64,
    /// What slows vehicle (N) or wheel (N m) beside everything else in the model: as recorded, ...
    pub lacking: f64,
    /// ... and as the mechanism has it.
    pub supplied: f64,
}

/// A mechanism's effect on the balance of wheel or vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Imbalance {
    /// The balance.
    pub balance: Balance,
    /// What the effect is a function of.
    pub against: Against,
    /// Stretches of one run without a gap.
    pub stretches: Vec<Vec<Instant>>,
}

impl Repaired {
    /// The effect of the mechanism at a place of [`Repaired::dynamics`] on a run; `None` where there is no such
    /// place, or the run's balance says nothing.
    ///
    /// # Errors
    /// [`RepairedError`] where the model cannot be run.
    pub fn imbalance(&self, run: &Run, place: usize) -> Result<Option<Imbalance>, RepairedError> {
        if self.dynamics.get(place).is_none() {
            return Ok(None);
        };
        let data = self.prepared(run);
        let (series, context) = (&data.series[0], &data.context);
        let with = self.dynamics_model(&data.catalogue)?;
        let mut without = with.clone();
        without.terms.remove(place);
        let mechanism = data.catalogue.get(with.terms[place].entry);
        let (balance, usable) = match mechanism.id().balance() {
            Balance::Vehicle if !series.vehicle_balance.is_empty() => {
                (Balance::Vehicle, &series.vehicle_balance)
            }
            // The scale of the drag is wrong in both balances.
            _ => (Balance::Wheel, &series.wheel_balance),
        };
        if usable.is_empty() {
            return Ok(None);
        }
        let chain = self.chain(run)?;
        let of = |model: &Model| {
            let p = model.vector();
            let chain = Some(chain.as_slice());
            match balance {
                Balance::Vehicle => vehicle(&data.catalogue, model, &p, series, context, chain),
                _ => wheel(&data.catalogue, model, &p, series, context, chain),
            }
        };
        let (left, lacking) = (of(&with), of(&without));
        let against = mechanism.facts().drawn_over;
        let at = channel(against, series);
        let stretches = usable
            .iter()
            .map(|stretch| {
                // The first step of a stretch comes from before it.
                stretch
                    .clone()
                    .skip(1)
                    .map(|k| Instant {
                        time_s: series.time[k],
                        at: at[k],
                        lacking: -lacking[k],
                        supplied: left[k] - lacking[k],
                    })
                    .collect()
            })
            .collect();
        Ok(Some(Imbalance {
            balance,
            against,
            stretches,
        }))
    }

    /// Reading less contact force by the tyre model, in N.
    fn chain(&self, run: &Run) -> Result<Vec<f64>, RepairedError> {
        let physics = Self {
            corrections: Vec::new(),
            ..self.clone()
        };
        let predicted = physics.predict(run, Which::Repaired)?;
        let chain = predicted
            .drag_force_n
            .iter()
            .zip(&predicted.contact_force_n);
        Ok(chain.map(|(reading, contact)| reading - contact).collect())
    }
}
