//! What the sources of two epochs show of the wall.

use crate::cloud::Cloud;
use nalgebra::{Point3, Vector3};

/// A station, a strip, or a whole epoch whose files keep no sources apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// How messages call it.
    pub name: String,
    /// 0 for the reference epoch, 1 for the later one.
    pub epoch: usize,
    /// Whether its points carry times that can order its errors; otherwise their place along the source
    /// stands in.
    pub has_times: bool,
    /// The source whose error it shares, as halves of one survey do; `None`: it has its own.
    pub same_as: Option<usize>,
}

/// A stone, or another small part of the wall, as the sources of both epochs show it.
#[derive(Clone, Debug)]
pub struct SeenStone {
    /// Centroid in the reference epoch, world, metres.
    pub centroid: Point3<f64>,
    /// Outward unit normal of the face there.
    pub normal: Vector3<f64>,
    /// What each source shows, at most one entry for a source.
    pub sights: Vec<SourcePoints>,
}

/// The points of a stone that come from one source.
#[derive(Clone, Debug)]
pub struct SourcePoints {
    /// Index into the sources.
    pub source: usize,
    /// Number of points.
    pub count: u64,
    /// Mean time of the points, seconds.
    pub time_s: f64,
    /// The points themselves, of stones whose sources are compared; empty for the others.
    pub points: Cloud,
}

/// One source's look at one place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    pub source: usize,
    pub time_s: f64,
    pub place: Point3<f64>,
    pub target: Target,
}

/// What a sight is of.
#[derive(Clone, Copy, Debug)]
pub(super) enum Target {
    /// A stone with this outward unit normal of its face.
    Stone { normal: Vector3<f64> },
    /// A plane of a stable area.
    Plane(StablePlane),
}

impl Sight {
    /// The plane of a stable area; `None` for a stone.
    pub fn plane(&self) -> Option<StablePlane> {
        match self.target {
            Target::Plane(plane) => Some(plane),
            Target::Stone { .. } => None,
        }
    }
}

/// A plane of a stable area.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct StablePlane {
    /// Which of the project's areas.
    pub area: usize,
    /// Number of the plane, over all areas.
    pub number: usize,
}
