//! The units of a project: what each is, what it needs, and what it will take.

use crate::error::Result;
use crate::pipeline::cost::{Cost, Sizes};
use crate::pipeline::graph::{About, Task};
use crate::pipeline::list::tasks;
use crate::pipeline::units::receipt::receipt_file;
use crate::pipeline::until::Until;
use crate::project::Project;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// A unit of work: a step, or one photo of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// Its name: that of the step with its epoch, and of a photo with `.NUMBER`.
    pub id: String,
    /// The step.
    pub step: String,
    /// The epoch that it is about, from 1; of a pair of epochs the later one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epoch: Option<usize>,
    /// Which photo of the step, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photo: Option<usize>,
    /// Units of one rank do not need each other, and only ones of lower ranks.
    pub rank: usize,
    /// The units that come before it.
    pub needs: BTreeSet<String>,
    /// The file, relative to the results folder, that says it is done.
    pub output: PathBuf,
    /// Threads that it makes good use of; it works with any number.
    pub cores: u32,
    /// Memory that it may take, bytes: estimated from the numbers of points and pixels.
    pub memory_bytes: u64,
    /// Whether it was done when the plan was made.
    pub done: bool,
}

/// Memory of any unit before it has read anything, bytes: the program, its threads, buffers of files.
const BASE_BYTES: u64 = 512 << 20;

/// All units of a project, each after those that it needs. The last one needs all others, and does the steps that
/// are no units.
pub(super) fn units_of(project: &Project) -> Result<Vec<Unit>> {
    let sizes = Sizes::of(project)?;
    let tasks = tasks(project, Until::Reported);
    let with_unit: Vec<_> = tasks
        .iter()
        .filter_map(|task| Some((task, task.step.cost?)))
        .collect();
    let mut units: Vec<Unit> = Vec::new();

    for (number, (task, cost)) in (1..).zip(&with_unit) {
        let mut before = match number == with_unit.len() {
            true => needed_by_none(&units),
            false => needs(task, project),
        };
        if let Some(photos) = &task.step.photos {
            let cost = (photos.cost)(&sizes, task.epoch);
            let all = 0..(photos.count)(project, task.epoch)?;
            let all: Vec<Unit> = all
                .map(|photo| unit(task, Some(photo), before.clone(), cost, &units))
                .collect();
            if !all.is_empty() {
                before = all.iter().map(|unit| unit.id.clone()).collect();
            }
            units.extend(all);
        }
        units.push(unit(task, None, before, cost(&sizes, task.epoch), &units));
    }

    Ok(units)
}

/// The units that a task needs; those of steps that are no unit need others in their place.
fn needs(task: &Task, project: &Project) -> BTreeSet<String> {
    let others = task.needs(project);
    let ids = others.iter().flat_map(|other| match other.step.cost {
        Some(_) => BTreeSet::from([other.id()]),
        None => needs(other, project),
    });
    ids.collect()
}

fn needed_by_none(units: &[Unit]) -> BTreeSet<String> {
    let needed: BTreeSet<&String> = units.iter().flat_map(|unit| &unit.needs).collect();
    let ids = units.iter().map(|unit| &unit.id);
    ids.filter(|id| !needed.contains(id)).cloned().collect()
}

/// The unit of a task, or of one photo of it; `earlier`: those that it may need.
fn unit(task: &Task, photo: Option<usize>, needs: BTreeSet<String>, cost: Cost, earlier: &[Unit]) -> Unit {
    let id = match photo {
        Some(number) => format!("{}.{number:05}", task.id()),
        None => task.id(),
    };
    let ranks = earlier.iter().filter(|u| needs.contains(&u.id)).map(|u| u.rank);
    Unit {
        step: task.step.name.to_owned(),
        epoch: (task.step.about != About::Survey).then(|| task.epoch.number()),
        photo,
        rank: ranks.max().map_or(0, |rank| rank + 1),
        needs,
        output: receipt_file(&id),
        cores: cost.cores,
        memory_bytes: BASE_BYTES + cost.bytes,
        done: false,
        id,
    }
}
