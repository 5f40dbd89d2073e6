//! The note that a unit is done: its output, as other programs see it.

use crate::error::{Error, Result};
use crate::files::write_json;
use crate::pipeline::clock::Clock;
use crate::results::names::WORK_DIR;
use crate::results::records::StepTime;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The folder of all receipts, in that of the steps.
const RECEIPTS: &str = "units";
/// The plan, beside it.
const PLAN: &str = "plan.json";

/// What is noted of a unit that is done.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Receipt {
    /// The unit.
    pub unit: String,
    /// The plan that it was done for.
    pub plan: String,
    /// What it took of its step.
    #[serde(flatten)]
    pub time: StepTime,
}

impl Receipt {
    /// Notes that a unit is done which began with the clock.
    pub fn write(out: &Path, plan: &str, unit: &str, clock: &Clock) -> Result<()> {
        let step = unit.split('.').next().unwrap_or_default();
        let receipt = Self {
            unit: unit.to_owned(),
            plan: plan.to_owned(),
            time: clock.step_time(step, false),
        };
        let path = out.join(receipt_file(unit));
        let folder = path.parent().unwrap_or(out);
        fs::create_dir_all(folder).map_err(Error::io("making a folder", folder))?;
        write_json(&path, &receipt)
    }

    /// The receipt of a unit under this plan; `None` where it is not done.
    pub fn read(out: &Path, plan: &str, unit: &str) -> Option<Self> {
        let text = fs::read(out.join(receipt_file(unit))).ok()?;
        let receipt: Self = serde_json::from_slice(&text).ok()?;
        (receipt.plan == plan && receipt.unit == unit).then_some(receipt)
    }
}

/// Where the receipt of a unit lies, relative to the results folder.
pub(super) fn receipt_file(unit: &str) -> PathBuf {
    Path::new(WORK_DIR).join(RECEIPTS).join(format!("{unit}.json"))
}

/// Where the plan lies.
pub(super) fn plan_file(out: &Path) -> PathBuf {
    out.join(WORK_DIR).join(PLAN)
}

/// Removes the receipt of a unit.
pub(super) fn withdraw(out: &Path, unit: &str) -> Result<()> {
    remove(&out.join(receipt_file(unit)), |path| fs::remove_file(path))
}

/// Removes all receipts.
pub(super) fn withdraw_all(out: &Path) -> Result<()> {
    remove(&out.join(WORK_DIR).join(RECEIPTS), |path| {
        fs::remove_dir_all(path)
    })
}

/// Removes a plan and its receipts: a run takes the folder over.
pub(in crate::pipeline) fn forget(out: &Path) -> Result<()> {
    remove(&plan_file(out), |path| fs::remove_file(path))?;
    withdraw_all(out)
}

fn remove(path: &Path, how: impl FnOnce(&Path) -> std::io::Result<()>) -> Result<()> {
    match how(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(Error::io("removing notes of an earlier plan", path)(error))
        }
        _ => Ok(()),
    }
}

/// Times of the steps whose units are done, by the name of the step; those of its photos are added.
pub(super) fn times<'a>(
    out: &Path,
    plan: &str,
    units: impl Iterator<Item = &'a str>,
) -> BTreeMap<String, StepTime> {
    let mut times: BTreeMap<String, StepTime> = BTreeMap::new();
    for Receipt { time, .. } in units.filter_map(|unit| Receipt::read(out, plan, unit)) {
        match times.get_mut(&time.step) {
            None => drop(times.insert(time.step.clone(), time)),
            Some(all) => {
                all.seconds += time.seconds;
                let processor_seconds = all.processor_seconds.zip(time.processor_seconds);
                all.processor_seconds = processor_seconds.map(|(a, b)| a + b);
                all.peak_memory_bytes = all.peak_memory_bytes.max(time.peak_memory_bytes);
            }
        }
    }
    times
}
