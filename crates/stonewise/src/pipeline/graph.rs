//! What a step declares about itself, and the run that makes its values.

use super::context::Context;
use super::cost::{Cost, Sizes};
use super::until::Until;
use crate::error::Result;
use crate::project::Project;
use crate::report_params::Language;
use std::any::{Any, TypeId};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;

/// A kind of step. A run, its agenda, a plan, a unit of a plan and the documentation are walks over these.
pub struct Step {
    /// Its name; with the epoch's number behind it that of its files, its unit and its time.
    pub name: &'static str,
    /// What a reader is told that it belongs to; `None`: it counts as part of the step before it.
    pub phase: Option<Phase>,
    /// What it is about.
    pub about: About,
    /// The steps that come first.
    pub needs: &'static [Need],
    /// Which runs do it, by how far they go.
    pub wanted: fn(Until) -> bool,
    /// Which projects and epochs have it.
    pub applies: fn(&Project, EpochId) -> bool,
    /// What it takes as a unit of a plan; `None`: the last unit does it.
    pub cost: Option<fn(&Sizes, EpochId) -> Cost>,
    /// Its photos, where each is a unit of its own.
    pub photos: Option<Photos>,
    /// Does it.
    pub make: fn(&Run, EpochId) -> Result<()>,
}

/// What steps are for, as a reader is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Looking at the survey and reading its clouds.
    Read,
    /// Finding stones in pictures and clouds.
    Find,
    /// Finding the stones of an epoch in another.
    Match,
    /// Measuring how the stones moved.
    Measure,
    /// Comparing the clouds without stones.
    Compare,
    /// Writing what a user opens.
    Write,
}

impl Phase {
    /// The phase in words.
    pub fn words(self, language: Language) -> &'static str {
        language.text(match self {
            Self::Read => "phases.read",
            Self::Find => "phases.find",
            Self::Match => "phases.match",
            Self::Measure => "phases.measure",
            Self::Compare => "phases.compare",
            Self::Write => "phases.write",
        })
    }
}

/// What a step is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum About {
    /// The survey as a whole.
    Survey,
    /// An epoch.
    Epoch,
    /// A later epoch against the reference.
    Later,
}

/// A step that comes before another.
#[derive(Clone, Copy)]
pub struct Need {
    pub(super) step: &'static Step,
    pub(super) of: Of,
    when: fn(&Project, EpochId) -> bool,
}

/// The epochs of which a step is needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    Same,
    Reference,
    FirstLater,
    All,
}

impl Need {
    /// The need for a step of the same epoch, or of the survey.
    pub const fn same(step: &'static Step) -> Self {
        Self::of(step, Of::Same)
    }

    /// The need for a step of the reference.
    pub const fn reference(step: &'static Step) -> Self {
        Self::of(step, Of::Reference)
    }

    /// The need for a step of the epoch after the reference.
    pub const fn first_later(step: &'static Step) -> Self {
        Self::of(step, Of::FirstLater)
    }

    /// The need for a step of all epochs.
    pub const fn all(step: &'static Step) -> Self {
        Self::of(step, Of::All)
    }

    /// Limits the need to the epochs for which `when` holds.
    pub const fn when(self, when: fn(&Project, EpochId) -> bool) -> Self {
        Self { when, ..self }
    }

    const fn of(step: &'static Step, of: Of) -> Self {
        let when = |_: &Project, _: EpochId| true;
        Self { step, of, when }
    }
}

/// The photos of a step, which other processes may do one by one before it.
pub struct Photos {
    /// How many there are.
    pub count: fn(&Project, EpochId) -> Result<usize>,
    /// What each takes as a unit.
    pub cost: fn(&Sizes, EpochId) -> Cost,
    /// Does one, counted from 0.
    pub make: fn(&Run, EpochId, usize) -> Result<()>,
}

impl Step {
    /// A step about the survey that every run does and that is no unit: what others change.
    pub const PLAIN: Self = Self {
        name: "",
        phase: None,
        about: About::Survey,
        needs: &[],
        wanted: |_| true,
        applies: |_, _| true,
        cost: None,
        photos: None,
        make: |_, _| Ok(()),
    };
}

/// A step with the epoch that it is about.
#[derive(Clone, Copy)]
pub struct Task {
    /// The step.
    pub step: &'static Step,
    /// The epoch; the reference where the step is about the survey.
    pub epoch: EpochId,
}

impl Task {
    /// Its name.
    pub fn id(&self) -> String {
        match self.step.about {
            About::Survey => self.step.name.to_owned(),
            About::Epoch | About::Later => format!("{}-{}", self.step.name, self.epoch),
        }
    }

    /// What a reader is told that it belongs to: to a phase, of several later epochs to that of each; `None` where it
    /// counts as part of the task before it.
    pub fn words(&self, project: &Project) -> Option<String> {
        let phase = self.step.phase?;
        let words = phase.words(project.settings.report.language);
        let is_of_pair = matches!(phase, Phase::Match | Phase::Measure | Phase::Compare);
        Some(match is_of_pair && project.epochs.len() > 2 {
            true => format!("{words} ({})", project.epochs[self.epoch].name),
            false => words.to_owned(),
        })
    }

    /// The tasks that come first; in place of one that the project does not have those that it would need.
    pub fn needs(&self, project: &Project) -> Vec<Self> {
        let needs = self.step.needs.iter().filter(|n| (n.when)(project, self.epoch));
        let tasks = needs.flat_map(|need| match (need.step.about, need.of) {
            (About::Survey, _) | (_, Of::Reference) => vec![(need.step, EpochId::REFERENCE)],
            (_, Of::Same) => vec![(need.step, self.epoch)],
            (_, Of::FirstLater) => vec![(need.step, EpochId::at(1))],
            (About::Epoch, Of::All) => project.epochs.ids().map(|e| (need.step, e)).collect(),
            (About::Later, Of::All) => project.epochs.later_ids().map(|e| (need.step, e)).collect(),
        });
        let others = tasks.map(|(step, epoch)| Self { step, epoch });
        others
            .filter(|task| task.id() != self.id())
            .flat_map(|task| match (task.step.applies)(project, task.epoch) {
                true => vec![task],
                false => task.needs(project),
            })
            .collect()
    }
}

/// The values of one run of a project. Each is made when it is asked for first, from others or from what an
/// earlier run left on disk; the steps add the methods that give them.
pub struct Run<'a> {
    /// Where to work, and whom to tell.
    pub context: &'a Context<'a>,
    /// How far it goes.
    pub until: Until,
    made: RefCell<BTreeMap<(String, TypeId), Arc<dyn Any + Send + Sync>>>,
}

impl<'a> Run<'a> {
    /// A run that goes so far.
    pub fn new(context: &'a Context<'a>, until: Until) -> Self {
        Self {
            context,
            until,
            made: RefCell::default(),
        }
    }

    /// What a step makes of an epoch.
    pub fn once<T: Any + Send + Sync>(
        &self,
        step: &'static Step,
        epoch: EpochId,
        make: impl FnOnce() -> Result<T>,
    ) -> Result<Arc<T>> {
        let id = Task { step, epoch }.id();
        self.known(&id, || self.context.in_line(&id, make))
    }

    /// The value of this name.
    pub fn known<T: Any + Send + Sync>(&self, id: &str, make: impl FnOnce() -> Result<T>) -> Result<Arc<T>> {
        let key = (id.to_owned(), TypeId::of::<T>());
        let known = self.made.borrow().get(&key).cloned();
        if let Some(value) = known.and_then(|value| value.downcast().ok()) {
            return Ok(value);
        }
        let value = Arc::new(make()?);
        self.made.borrow_mut().insert(key, value.clone());
        Ok(value)
    }
}
