//! What a stop cannot be set up with.

/// A filter, a controller or one of their steps that was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// The filter's configuration.
    #[error(transparent)]
    Filter(#[from] muslip::filter::quarter_car::ConfigError),
    /// A step of the filter.
    #[error(transparent)]
    Step(#[from] muslip::filter::quarter_car::StepError),
    /// The setpoint's two-state filter.
    #[error(transparent)]
    Peak(#[from] muslip::filter::mu_slip::UpdateError),
    /// The seeker of the setpoint.
    #[error(transparent)]
    Seeker(#[from] muslip::control::peak_seeker::ConfigError),
    /// The controller.
    #[error(transparent)]
    Control(#[from] muslip::control::slip::ControlError),
}
