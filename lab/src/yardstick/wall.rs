//! A wall of which all is known: what its stones did, and what the sources of both epochs measured.

use super::points::Points;
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use stonewise_core::geometry::Rigid3;
use stonewise_core::registration::observers::PhotoNetwork;

/// Share of a face that must be seen in both epochs for the stone to count.
pub const LEAST_SEEN: f64 = 0.35;

/// What is true of a stone; world, metres.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Roughly the outward normal of the face.
    pub normal: Vector3<f64>,
    /// `p2 = motion * p1`.
    pub motion: Rigid3,
    /// The displacement that it shares with its neighbours.
    pub shared: Vector3<f64>,
    pub is_loose: bool,
    /// Whole, seen well enough in both epochs, and its masks are right. Other stones count only where they are
    /// grossly wrong.
    pub is_countable: bool,
    /// Its mask or its partner in one epoch is another stone's: no motion is the right answer.
    pub is_odd: bool,
}

impl Truth {
    pub fn is_still(&self) -> bool {
        self.motion == Rigid3::identity()
    }

    pub fn displacement(&self, place: &Point3<f64>) -> Vector3<f64> {
        self.motion * place - place
    }
}

/// A part of the wall that truly deformed: its middle, and its largest motion, metres.
#[derive(Clone, Copy, Debug)]
pub struct Area {
    pub middle: Point3<f64>,
    pub largest_m: f64,
}

/// Both epochs with their truth.
#[derive(Clone, Default)]
pub struct Wall {
    /// By stone of the first epoch; 0 holds what is no stone.
    pub epochs: [Points; 2],
    pub truth: BTreeMap<u32, Truth>,
    pub areas: Vec<Area>,
    /// Whether nothing moved but what the areas hold, and single stones.
    pub is_still_elsewhere: bool,
    /// Whether no stone of the wall moved.
    pub is_still: bool,
    pub has_times: [bool; 2],
    /// Whether what stands before the wall is named as stable.
    pub has_stable: bool,
    /// The photos from which the clouds were computed, where they were.
    pub network: Option<PhotoNetwork>,
}
