//! What is measured: a filter, on a processor, at a level of optimisation.

/// A processor that the candidates are built for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Core {
    M4F,
    M0,
}

impl Core {
    pub fn name(self) -> &'static str {
        match self {
            Self::M4F => "cortex-m4f",
            Self::M0 => "cortex-m0",
        }
    }

    pub fn triple(self) -> &'static str {
        match self {
            Self::M4F => "thumbv7em-none-eabihf",
            Self::M0 => "thumbv6m-none-eabi",
        }
    }

    /// Without the cpu, the compiler fuses multiplications and additions, which on a Cortex-M4 costs more
    /// cycles than it saves.
    pub fn cpu(self) -> &'static str {
        match self {
            Self::M4F => "cortex-m4",
            Self::M0 => "cortex-m0",
        }
    }

    /// The Cortex-M3 executes a Cortex-M0's instructions as they are.
    pub fn machine(self) -> &'static str {
        match self {
            Self::M4F => "mps2-an386",
            Self::M0 => "mps2-an385",
        }
    }
}

/// One image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Candidate {
    pub name: &'static str,
    pub core: Core,
    pub opt: &'static str,
    /// 10,000 samples of a rig in place of the article's 41 points.
    pub long: bool,
}

impl Candidate {
    pub const fn on(name: &'static str, core: Core, opt: &'static str) -> Self {
        Self {
            name,
            core,
            opt,
            long: false,
        }
    }

    /// Its name in the budgets and of its image.
    pub fn key(&self) -> String {
        let Self {
            name, core, opt, ..
        } = self;
        let long = if self.long { "-long" } else { "" };
        format!("{name}-{}-{opt}{long}", core.name())
    }
}

/// Ours.
pub const OURS: [&str; 6] = [
    "article",
    "article_checked",
    "article_report",
    "efficient",
    "slip_friction",
    "quarter_car",
];

/// Ours, a whole sample a call; for the controller alone and within its share of a sample.
pub const SAMPLED: [&str; 1] = ["innovations"];

const PEERS: [&str; 4] = ["nalgebra", "kfilter", "adskalman", "minikalman"];

/// All rows, in the table's order.
pub fn candidates() -> Vec<Candidate> {
    let each = |names: &'static [&'static str], core, opt| {
        names.iter().map(move |name| Candidate::on(name, core, opt))
    };
    let mut all: Vec<Candidate> = each(&OURS, Core::M4F, "3").collect();
    all.push(Candidate {
        long: true,
        ..Candidate::on("efficient", Core::M4F, "3")
    });
    all.extend(each(&SAMPLED, Core::M4F, "3"));
    all.extend(each(&PEERS, Core::M4F, "3"));
    all.extend(each(&OURS, Core::M4F, "s"));
    all.extend(each(&SAMPLED, Core::M4F, "s"));
    all.extend(each(&OURS, Core::M0, "3"));
    all
}
