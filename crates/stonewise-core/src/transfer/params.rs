//! What can be chosen in the transfer of labels.

use crate::params::{Params, Range, Ranged, with_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`crate::transfer::transfer_labels`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct TransferParams {
    /// Memory for the depth maps of all photos together, MiB. Where full resolution needs more, all maps are
    /// made at the same smaller resolution. 1 GiB: 78 photos of 12 MP are kept at about half resolution,
    /// which is still finer than a 5 mm point spacing seen from 10 m.
    pub depth_memory_mib: u32,
    /// Side of the cells in which spacing, noise and incidence are estimated, metres. About one stone: large
    /// enough for a stable normal of the face, small enough to follow the scanner's uneven density.
    pub cell_m: f64,
    /// Half width of a splat in units of the local point spacing. 1: four points of a randomly sampled
    /// surface fall on every splat, so that two pixels in a hundred stay open; wider ones let railings and
    /// leaves hide the wall beside them, which costs more labels than open pixels let through.
    pub splat_spacings: f64,
    /// Depth tolerance in units of the local spacing on a face that looks at the camera; grows with the
    /// tangent of the incidence angle. 4: twice the width of a splat, the depth that the splat itself spans
    /// at 45 degrees.
    pub tolerance_spacings: f64,
    /// Depth tolerance in units of the local range noise. 4: the nearest of many noisy points lies 2 to 3
    /// sigma in front of the surface.
    pub tolerance_noises: f64,
    /// A step in depth of more than this between a point and its pixel's neighbourhood marks a silhouette,
    /// metres. 0.15: more than the relief of rubble masonry, less than the distance of a railing to the wall.
    pub silhouette_step_m: f64,
    /// Photos hardly count for points this close to a silhouette, pixels of the photo. 2: covers poses that
    /// are off by half a pixel to one pixel, and blurred mask borders.
    pub silhouette_px: f64,
    /// Weight of a photo for points at a silhouette. 0.05: such photos decide only where no photo sees
    /// better, behind railings and shrubs.
    pub silhouette_weight: f64,
    /// Steepest angle between line of sight and face normal at which a photo votes, radians. 1.4 (80
    /// degrees): beyond, a mask border one pixel off moves by six pixels on the face.
    pub max_incidence_rad: f64,
    /// Side of the voxels that thin the points on which photos are compared, metres. 0.01: overlaps count
    /// area, not density, and the smallest countable stones (5 cm) still have 25 samples.
    pub sample_m: f64,
    /// Least intersection over union at which instances of two photos may be one stone. 0.3: half of a stone
    /// that one photo shows as two still finds it; the majority decides afterwards.
    pub min_iou: f64,
    /// Share of an instance's area that another stone must win to count as one of the stones it merges. 0.15:
    /// border effects of one pixel stay below on stones of 20 pixels and more.
    pub merged_share: f64,
    /// Share of a stone's area that its photos must win against other stones to keep it. 0.35: a stone of
    /// which the majority shows little else is gone, one that a neighbour overlaps is not.
    pub min_won_share: f64,
    /// Weight, against a stone as a whole, of a photo that sees its place and shows no part of it. 0.25: a
    /// stone that one photo shows and four do not is kept. Segmentation misses stones (recall 0.72 in the
    /// paper), the same ones in many photos, far more often than it invents them (precision 0.92); a false
    /// stone finds no partner in the other epoch, a missed one is lost.
    pub missed_weight: f64,
    /// Weight of a background vote of a photo that shows the stone elsewhere. 0.8: where two photos of nearly
    /// equal weight disagree about a part of a stone, the part is kept, as masks leave out more than they
    /// add.
    pub border_weight: f64,
    /// Parts of a stone that are separated by more than about this are islands, metres. 0.04: wider than gaps
    /// in a cloud, narrower than a stone.
    pub island_link_m: f64,
    /// Islands smaller than this share of the stone's largest part are dropped. 0.2: a railing that cuts a
    /// stone in two leaves both halves.
    pub island_share: f64,
    /// Stones with fewer points are dropped. 30: no rigid motion can be estimated from fewer.
    pub min_points: u32,
}

impl Default for TransferParams {
    fn default() -> Self {
        Self {
            depth_memory_mib: 1024,
            cell_m: 0.25,
            splat_spacings: 1.0,
            tolerance_spacings: 4.0,
            tolerance_noises: 4.0,
            silhouette_step_m: 0.15,
            silhouette_px: 2.0,
            silhouette_weight: 0.05,
            max_incidence_rad: 1.4,
            sample_m: 0.01,
            min_iou: 0.3,
            merged_share: 0.15,
            min_won_share: 0.35,
            missed_weight: 0.25,
            border_weight: 0.8,
            island_link_m: 0.04,
            island_share: 0.2,
            min_points: 30,
        }
    }
}

impl Params for TransferParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::POSITIVE.holds("depth_memory_mib", self.depth_memory_mib),
            Range::POSITIVE.holds("cell_m", self.cell_m),
            Range::POSITIVE.holds("splat_spacings", self.splat_spacings),
            Range::NOT_NEGATIVE.holds("tolerance_spacings", self.tolerance_spacings),
            Range::NOT_NEGATIVE.holds("tolerance_noises", self.tolerance_noises),
            Range::NOT_NEGATIVE.holds("silhouette_step_m", self.silhouette_step_m),
            Range::NOT_NEGATIVE.holds("silhouette_px", self.silhouette_px),
            Range::NOT_NEGATIVE.holds("silhouette_weight", self.silhouette_weight),
            Range::NOT_NEGATIVE.holds("max_incidence_rad", self.max_incidence_rad),
            Range::POSITIVE.holds("sample_m", self.sample_m),
            Range::SHARE.holds("min_iou", self.min_iou),
            Range::SHARE.holds("merged_share", self.merged_share),
            Range::SHARE.holds("min_won_share", self.min_won_share),
            Range::NOT_NEGATIVE.holds("missed_weight", self.missed_weight),
            Range::NOT_NEGATIVE.holds("border_weight", self.border_weight),
            Range::NOT_NEGATIVE.holds("island_link_m", self.island_link_m),
            Range::SHARE.holds("island_share", self.island_share),
            Range::NOT_NEGATIVE.holds("min_points", self.min_points),
        ]
    }
}
