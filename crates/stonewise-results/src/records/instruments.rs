//! `instruments.json`: other instruments beside the stones around them.

use serde::{Deserialize, Serialize};

/// Version of the file's layout.
pub const INSTRUMENTS_VERSION: u32 = 1;

/// Other instruments beside the stones around them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InstrumentsRecord {
    /// Version of the file's layout.
    pub version: u32,
    /// Each later epoch.
    pub epochs: Vec<InstrumentsEpoch>,
}

/// Instruments in a later epoch, against the reference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InstrumentsEpoch {
    /// Name of the epoch.
    pub epoch: String,
    /// Probability of so large differences of all instruments together by chance; absent where nothing can be tested.
    pub p: Option<f64>,
    /// Instruments that are compared, by file and name.
    pub compared: Vec<ComparedInstrument>,
    /// Instruments that are not compared.
    pub left_out: Vec<LeftOutInstrument>,
    /// What those in use did to the datum; absent where none is in use.
    pub datum: Option<DatumUse>,
}

/// An instrument beside the stones around it; world, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComparedInstrument {
    /// Its name.
    pub name: String,
    /// Name of its file.
    pub file: String,
    /// Where it is.
    pub place: [f64; 3],
    /// What it moved since the reference along x, y and z; null along axes that it does not measure.
    pub motion_m: [Option<f64>; 3],
    /// Standard deviations.
    pub sd_m: [Option<f64>; 3],
    /// The stones around it.
    pub stones: Vec<u32>,
    /// How far from it their middle is.
    pub distance_m: f64,
    /// Their mean motion, before the instruments in use change the datum.
    pub stones_m: [f64; 3],
    /// The difference that is tested, stones less instrument: where the datum is unknown, less what the other instruments
    /// say of it; null where they do not determine it.
    pub difference_m: [Option<f64>; 3],
    /// Standard deviations, with the registration error where it is known.
    pub difference_sd_m: [Option<f64>; 3],
    /// Probability of so large a difference by chance.
    pub p: Option<f64>,
    /// Whether it agrees with the stones, at 95 % over all instruments of the epoch (Bonferroni); null where that cannot be
    /// tested.
    pub agrees: Option<bool>,
    /// Whether its file is in use for the datum.
    pub is_used: bool,
}

/// An instrument that is not compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftOutInstrument {
    /// Its name.
    pub name: String,
    /// Name of its file.
    pub file: String,
    /// Why.
    #[serde(flatten)]
    pub why: WhyLeftOut,
}

/// Why an instrument is not compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum WhyLeftOut {
    /// An epoch has no date.
    NoDate,
    /// The reference or the epoch lies before its first reading.
    BeforeReadings,
    /// The reference or the epoch lies after its last reading.
    AfterReadings,
    /// Its readings before and after lie too far apart.
    Gap {
        /// How far.
        days: f64,
    },
    /// No stone near it was measured.
    NoStones {
        /// Within this distance.
        reach_m: f64,
    },
}

/// What instruments in use did to the datum of an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DatumUse {
    /// They are observations of it.
    Observed,
    /// They do not determine it, and nothing else is known of it.
    Undetermined,
    /// They contradict each other or the datum, and are not used.
    Contradicted,
}
