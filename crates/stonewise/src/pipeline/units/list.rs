//! The units of a project: what each is, what it needs, and what it will take.

use crate::error::Result;
use crate::pipeline::cost::{Cost, Sizes};
use crate::pipeline::graph::{About, PartKind, Task};
use crate::pipeline::list::tasks;
use crate::pipeline::part::Part;
use crate::pipeline::units::receipt::receipt_file;
use crate::pipeline::until::Until;
use crate::project::Project;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use stonewise_core::epoch::EpochId;

/// A unit of work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// Its name: that of the step, with `.PART` where it is a part of one.
    pub id: String,
    /// What it does: the step, and `-photo`, `-prepare` or `-tiles` where it is a part of one.
    pub stage: String,
    /// The epoch that it is about, from 1; of a pair of epochs the later one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epoch: Option<usize>,
    /// Which part of the step, from 0: a photo or a batch of tiles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<usize>,
    /// How many parts of its kind the step has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parts: Option<usize>,
    /// Units that come first. Units of one rank do not need each other, and only ones of lower ranks.
    pub rank: usize,
    /// The units that it needs; what these need is left out.
    pub needs: Vec<String>,
    /// Files that must be there: of the survey, and, relative to the results folder, the outputs of the units
    /// that it needs.
    pub inputs: Vec<PathBuf>,
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

/// All units of a project, each after those that it needs; `batch_points`: points of a cloud in a batch of
/// tiles, about. The last one needs all others, and does the steps that are no units.
pub(super) fn units_of(project: &Project, batch_points: u64) -> Result<Vec<Unit>> {
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
        let mut whole = None;
        if let Some(parts) = &task.step.parts {
            let cost = || (parts.cost)(&sizes, task.epoch);
            if let PartKind::PreparedTiles = parts.kind {
                before = vec![list.push(task, Some(Part::Prepare), None, &before, cost())];
            }
            let all = parts_of(parts.kind, task, &sizes, batch_points)?;
            let add = |part: &Part| list.push(task, Some(*part), Some(all.len()), &before, cost());
            let ids: Vec<String> = all.iter().map(add).collect();
            if let Some(Part::Tiles(_, count)) = all.first() {
                whole = Some(*count);
            }
            if !ids.is_empty() {
                before = ids;
            }
        }
        list.push(task, None, whole, &before, cost(&sizes, task.epoch));
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

/// The parts of a step but the one that comes first.
fn parts_of(kind: PartKind, task: &Task, sizes: &Sizes, batch_points: u64) -> Result<Vec<Part>> {
    let tiles = |epoch: EpochId| {
        let points = sizes.points[epoch];
        // Names have three digits.
        let count = points.div_ceil(batch_points.max(1)).clamp(1, 999) as usize;
        (0..count).map(|number| Part::Tiles(number, count)).collect()
    };
    Ok(match kind {
        PartKind::Photos(count) => (0..count(sizes.project, task.epoch)?).map(Part::Photo).collect(),
        PartKind::PreparedTiles => tiles(task.epoch),
        PartKind::ReferenceTiles => tiles(EpochId::REFERENCE),
    })
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
    /// Adds a task or a part of it; its name. `parts`: how many of its kind there are.
    fn push(
        &mut self,
        task: &Task,
        part: Option<Part>,
        parts: Option<usize>,
        needs: &[String],
        cost: Cost,
    ) -> String {
        let name = part.map(|part| (format!("{}.{}", task.id(), part.name()), part.kind()));
        let (id, stage) = match name {
            Some((id, kind)) => (id, format!("{}-{kind}", task.step.name)),
            None => (task.id(), task.step.name.to_owned()),
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
        let outputs = needs.iter().map(|id| receipt_file(id));
        self.units.push(Unit {
            stage,
            epoch: (task.step.about != About::Survey).then(|| task.epoch.number()),
            part: match part {
                Some(Part::Photo(number) | Part::Tiles(number, _)) => Some(number),
                _ => None,
            },
            parts,
            rank,
            inputs: cost.inputs.into_iter().chain(outputs).collect(),
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
