//! What the units of a plan take.

use crate::error::Result;
use crate::project::Project;
use crate::storage::tiles::most_records;
use stonewise_core::epoch::{EpochId, Epochs};

/// What a unit takes.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// Threads that it makes good use of.
    pub cores: u32,
    /// Memory beyond that of the program at rest.
    pub bytes: u64,
}

impl Cost {
    /// The cost of a unit.
    pub const fn of(cores: u32, bytes: u64) -> Self {
        Self { cores, bytes }
    }
}

/// Memory of steps that go through a cloud, for each of its points, bytes: the labels of the points of a file
/// while it is written, the cells that are covered while stones are matched.
const POINT_BYTES: u64 = 16;

/// How large a survey is.
pub struct Sizes<'a> {
    /// The survey.
    pub project: &'a Project,
    /// Points that the clouds of each epoch say they hold; of files that do not say so, as many as fit in
    /// their length.
    pub points: Epochs<u64>,
    /// Pixels of the largest photo of each epoch.
    pub pixels: Epochs<u64>,
}

impl<'a> Sizes<'a> {
    /// Reads the headers of clouds, and the camera files.
    pub fn of(project: &'a Project) -> Result<Self> {
        let mut points = Vec::new();
        let mut pixels = Vec::new();
        for id in project.epochs.ids() {
            let epoch = &project.epochs[id];
            let records = epoch.clouds.iter().map(|cloud| most_records(cloud));
            points.push(records.sum::<Result<u64>>()?);
            let views = epoch.read_cameras()?.views.into_iter();
            let sizes = views.map(|v| u64::from(v.camera.width) * u64::from(v.camera.height));
            let side = u64::from(project.settings.views.side_px);
            let views = project.has_views(id).then_some(side * side);
            pixels.push(sizes.chain(views).max().unwrap_or(0));
        }
        Ok(Self {
            project,
            points: points.into(),
            pixels: pixels.into(),
        })
    }

    /// Memory of a step that goes through the cloud of an epoch, bytes.
    pub fn cloud_bytes(&self, epoch: EpochId) -> u64 {
        POINT_BYTES * self.points[epoch]
    }

    /// Points of the reference and of an epoch.
    pub fn pair_points(&self, later: EpochId) -> u64 {
        self.points.reference() + self.points[later]
    }

    /// Memory of a step that goes through the clouds of the reference and of an epoch, bytes.
    pub fn pair_bytes(&self, later: EpochId) -> u64 {
        POINT_BYTES * self.pair_points(later)
    }

    /// Memory of a step that goes through the reference and one later epoch after the other, bytes.
    pub fn every_pair_bytes(&self) -> u64 {
        let pairs = self.points.later_ids().map(|later| self.pair_bytes(later));
        pairs.max().unwrap_or(0)
    }
}
