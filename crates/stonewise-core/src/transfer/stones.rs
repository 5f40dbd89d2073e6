//! The table of stones, from points and their labels.

use super::area::Footprint;
use super::each_tile::each_tile;
use super::face::FaceCells;
use super::transfer_labels::count_photos;
use super::{LabelStore, StoneInstances, TileLabels, TransferError};
use crate::cloud::{Cloud, TileSource};
use crate::geometry::{Bounds, FaceFrame, View};
use crate::id::{ImageId, StoneId};
use crate::params::{Params, Range, Ranged, with_ranges};
use crate::progress::Progress;
use crate::stone::Stone;
use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Parameters of [`build_stones`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct StoneParams {
    /// Radius of the wall around a stone whose plane is the stone's face, metres. 0.75: several stones, so
    /// that bumps of single stones average out, yet little of a dam's curvature.
    pub face_radius_m: f64,
}

impl Default for StoneParams {
    fn default() -> Self {
        Self { face_radius_m: 0.75 }
    }
}

impl Params for StoneParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![Range::POSITIVE.holds("face_radius_m", self.face_radius_m)]
    }
}

/// One row for each stone that has points, ascending by id.
///
/// `tiles` may have been moved after they were labelled, as long as every tile holds the same points in the
/// same order. `views` and `instances` tell which photos show a stone: they give the number of photos and the
/// side from which the wall is seen, towards which the normals point. The area is that of the stone's points
/// on its face, corrected for density.
///
/// Cost: two passes over the tiles.
///
/// # Errors
/// A tile or its labels cannot be read or do not fit together, interruption.
pub fn build_stones<T: TileSource, S: LabelStore>(
    tiles: &T,
    labels: &S,
    views: &[View],
    instances: &[StoneInstances],
    params: &StoneParams,
    progress: &dyn Progress,
) -> Result<Vec<Stone>, TransferError> {
    params.check()?;
    let mut sums: BTreeMap<u32, Sums> = BTreeMap::new();
    let mut face = FaceCells::new();
    each_tile(tiles, labels, "stones", progress, |_, cloud, labels| {
        add_tile(&mut sums, &mut face, cloud, labels);
    })?;
    let centres: BTreeMap<ImageId, Point3<f64>> = views.iter().map(|v| (v.image, v.centre())).collect();
    let of_stone: BTreeMap<u32, &StoneInstances> = instances.iter().map(|i| (i.stone.0, i)).collect();
    let mut patches: BTreeMap<u32, Patch> = sums
        .iter()
        .map(|(&id, s)| {
            let towards = s.towards_cameras(of_stone.get(&id).copied(), &centres);
            (id, Patch::new(s, s.face_normal(&face, params, &towards)))
        })
        .collect();

    each_tile(tiles, labels, "stone faces", progress, |_, cloud, labels| {
        for (i, stone) in labels.stone.iter().enumerate() {
            if let Some(patch) = patches.get_mut(stone) {
                patch.add(&cloud.world(i));
            }
        }
    })?;

    Ok(sums
        .iter()
        .zip(patches.values())
        .map(|((&id, s), patch)| Stone {
            id: StoneId(id),
            centroid: s.centroid(),
            normal: patch.frame.out,
            area_m2: patch.footprint.area_m2(),
            points: s.points,
            photos: of_stone.get(&id).map_or(0, |i| count_photos(&i.instances)),
            confidence: s.confidence / f64::from(s.points),
        })
        .collect())
}

/// Running sums of a stone, about its first point.
struct Sums {
    base: Point3<f64>,
    sum: Vector3<f64>,
    bounds: Bounds,
    points: u32,
    confidence: f64,
}

fn add_tile(sums: &mut BTreeMap<u32, Sums>, face: &mut FaceCells, cloud: &Cloud, labels: &TileLabels) {
    for (i, (&stone, &confidence)) in labels.stone.iter().zip(&labels.confidence).enumerate() {
        if stone == 0 {
            continue;
        }
        let p = cloud.world(i);
        face.add(&p);
        let s = sums.entry(stone).or_insert_with(|| Sums {
            base: p,
            sum: Vector3::zeros(),
            bounds: Bounds { min: p, max: p },
            points: 0,
            confidence: 0.0,
        });
        s.sum += p - s.base;
        s.bounds = Bounds {
            min: s.bounds.min.inf(&p),
            max: s.bounds.max.sup(&p),
        };
        s.points += 1;
        s.confidence += f64::from(confidence);
    }
}

impl Sums {
    fn centroid(&self) -> Point3<f64> {
        self.base + self.sum / f64::from(self.points)
    }

    /// From the stone to the middle of the cameras that show it, or of all cameras.
    fn towards_cameras(
        &self,
        instances: Option<&StoneInstances>,
        centres: &BTreeMap<ImageId, Point3<f64>>,
    ) -> Vector3<f64> {
        let own: Vec<&Point3<f64>> = instances
            .iter()
            .flat_map(|i| &i.instances)
            .filter_map(|(photo, _)| centres.get(photo))
            .collect();
        let cameras = if own.is_empty() {
            centres.values().collect()
        } else {
            own
        };
        let centroid = self.centroid();
        cameras.iter().map(|c| (*c - centroid).normalize()).sum()
    }

    /// Outward normal of the wall; towards the cameras where too little of the wall is known.
    fn face_normal(&self, face: &FaceCells, params: &StoneParams, towards: &Vector3<f64>) -> Vector3<f64> {
        let centroid = self.centroid();
        let normal = face
            .normal(&centroid, params.face_radius_m)
            .or_else(|| face.normal(&centroid, 2.0 * params.face_radius_m))
            .unwrap_or(*towards);
        if normal.dot(towards) < 0.0 {
            -normal
        } else {
            normal
        }
    }
}

/// A stone's points on its face.
struct Patch {
    frame: FaceFrame,
    centre: Point3<f64>,
    footprint: Footprint,
}

impl Patch {
    fn new(sums: &Sums, normal: Vector3<f64>) -> Self {
        let frame = FaceFrame::from_normal(&normal);
        let centre = sums.centroid();
        let corners = sums.bounds.corners().map(|c| on_face(&frame, &(c - centre)));
        let range =
            |a: usize, pick: fn(f64, f64) -> f64| corners.iter().map(|c| c[a]).reduce(pick).unwrap_or(0.0);
        let low = [range(0, f64::min), range(1, f64::min)];
        let high = [range(0, f64::max), range(1, f64::max)];
        Self {
            frame,
            centre,
            footprint: Footprint::new(low, high),
        }
    }

    fn add(&mut self, world: &Point3<f64>) {
        self.footprint.add(on_face(&self.frame, &(world - self.centre)));
    }
}

fn on_face(frame: &FaceFrame, offset: &Vector3<f64>) -> [f64; 2] {
    [frame.along.dot(offset), frame.up.dot(offset)]
}
