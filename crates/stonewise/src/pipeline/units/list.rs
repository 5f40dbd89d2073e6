//! The units of a project: what each is, what it needs, and what it will take.

use crate::error::Result;
use crate::pipeline::cost::{Cost, Sizes};
use crate::pipeline::graph::{About, Task};
use crate::pipeline::list::tasks;
use crate::pipeline::units::receipt::receipt_file;
use crate::pipeline::until::Until;
use crate::project::Project;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
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
    /// Units that come first. Units of one rank do not need each other, and only ones of lower ranks.
    pub rank: usize,
    /// The units that it needs; what these need is left out.
    pub needs: Vec<String>,
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
    let mut list = List::default();

    for (number, (task, cost)) in (1..).zip(&with_unit) {
        let mut before = match number == with_unit.len() {
            true => list.units.iter().map(|unit| unit.id.clone()).collect(),
            false => needs(task, project),
        };
        if let Some(photos) = &task.step.photos {
            let cost = (photos.cost)(&sizes, task.epoch);
            let all = 0..(photos.count)(project, task.epoch)?;
            let ids: Vec<String> = all
                .map(|photo| list.push(task, Some(photo), &before, cost))
                .collect();
            if !ids.is_empty() {
                before = ids;
            }
        }
        list.push(task, None, &before, cost(&sizes, task.epoch));
    }

    Ok(list.units)
}

/// The units that a task needs; those of steps that are no unit need others in their place.
fn needs(task: &Task, project: &Project) -> Vec<String> {
    let others = task.needs(project);
    let ids = others.iter().flat_map(|other| match other.step.cost {
        Some(_) => vec![other.id()],
        None => needs(other, project),
    });
    ids.collect()
}

/// Units as they are added.
#[derive(Default)]
struct List {
    units: Vec<Unit>,
    ranks: BTreeMap<String, usize>,
    /// What each unit needs, and what that needs.
    before: BTreeMap<String, BTreeSet<String>>,
}

impl List {
    /// Adds a task or one photo of it; its name.
    fn push(&mut self, task: &Task, photo: Option<usize>, needs: &[String], cost: Cost) -> String {
        let id = match photo {
            Some(number) => format!("{}.{number:05}", task.id()),
            None => task.id(),
        };
        let needs = self.without_implied(needs);
        let mut before: BTreeSet<String> = needs.iter().cloned().collect();
        before.extend(
            needs
                .iter()
                .filter_map(|id| self.before.get(id))
                .flatten()
                .cloned(),
        );

        let ranks = needs.iter().filter_map(|id| self.ranks.get(id));
        let rank = ranks.max().map_or(0, |rank| rank + 1);
        self.before.insert(id.clone(), before);
        self.ranks.insert(id.clone(), rank);
        self.units.push(Unit {
            step: task.step.name.to_owned(),
            epoch: (task.step.about != About::Survey).then(|| task.epoch.number()),
            photo,
            rank,
            needs,
            output: receipt_file(&id),
            cores: cost.cores,
            memory_bytes: BASE_BYTES + cost.bytes,
            done: false,
            id: id.clone(),
        });

        id
    }

    /// Needs that no other of them needs, once each.
    fn without_implied(&self, needs: &[String]) -> Vec<String> {
        let mut seen: BTreeSet<&String> = { needs.iter() }
            .filter_map(|id| self.before.get(id))
            .flatten()
            .collect();
        needs.iter().filter(|&id| seen.insert(id)).cloned().collect()
    }
}
