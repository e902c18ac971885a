//! What a stop cannot be set up with.

/// A filter, a controller or one of their steps that was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// The filter's configuration.
    #[error(transparent)]
    Filter(#[from] muslip_quarter_car::filter::ConfigError),
    /// A step of the filter.
    #[error(transparent)]
    Step(#[from] muslip_quarter_car::filter::StepError),
    /// The setpoint's two-state filter.
    #[error(transparent)]
    Peak(#[from] muslip::filter::mu_slip::UpdateError),
    /// The seeker of the setpoint.
    #[error(transparent)]
    Seeker(#[from] muslip_quarter_car::peak_seeker::ConfigError),
    /// The controller.
    #[error(transparent)]
    Control(#[from] muslip_quarter_car::slip_control::ControlError),
}
