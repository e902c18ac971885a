//! The generator: rigs, plans and tyres of its own, effects to conceal, measuring chains, and the sealed truth.
//!
//! | what | module |
//! | --- | --- |
//! | which campaigns | [`strata`], [`form`] |
//! | rig, programme, motion | [`rig`], [`plan`], [`sim`], [`tyre`], [`effect`] |
//! | what the instruments make of it | [`chain`], [`noise`], [`instrument`] |
//! | one campaign, its files | [`campaign`], [`files`] |
//! | its truth | [`figures`], [`measure`], [`oracle`], [`attainable`] |

/// Declares the modules and keeps their text, so that campaigns of another generator can be told.
macro_rules! modules {
    ($($name:ident),* $(,)?) => {
        $(pub mod $name;)*
        /// The generator's own text.
        pub const TEXT: &[&str] = &[$(include_str!(concat!(stringify!($name), ".rs"))),*, include_str!("../draw.rs")];
    };
}

modules!(
    attainable, campaign, chain, effect, figures, files, form, measure, noise, oracle, plan, rig,
    sim, strata, tyre,
);

pub mod instrument;

#[cfg(test)]
mod checks;
