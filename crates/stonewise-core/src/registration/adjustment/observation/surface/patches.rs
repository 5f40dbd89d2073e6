//! The face of a stone cut into patches, each with the points of both epochs.

use super::cells::{COMPARE_CELLS, CellSums};
use super::inverse_motion::InverseMotion;
use super::layout::Layout;
use super::local_pair::LocalPair;
use super::patch_grid::{PatchGrid, WeightedPoint};
use super::surface_noise::SurfaceNoise;

/// Points in each epoch that a patch needs: twice the unknowns of a plane, for a fit whose outliers can be detected.
const PATCH_POINTS: usize = 12;
/// Width by which a face is widened, in cells: points that noise moved beyond the first epoch's outline still
/// count.
const MARGIN_CELLS: f64 = 2.0;
/// The grid of cells follows the second epoch's points where these weigh more by this factor. How well a surface
/// of cells follows points depends on where the cells lie between them, and sharp points notice: a motion of
/// these over the grid would seem likely or unlikely by itself.
const HEAVIER: f64 = 2.0;
/// Shortest side of a patch, in cells: a cubic spline's four coefficients.
const LEAST_CELLS: usize = 4;

/// A piece of the face with the points of both epochs.
pub(crate) struct PatchPoints {
    pub grid: PatchGrid,
    pub epochs: [Vec<WeightedPoint>; 2],
    /// Roughness of the stone over that of most.
    pub roughness: f64,
}

pub(crate) struct Patches {
    pub list: Vec<PatchPoints>,
    pub overlap: f64,
}

/// Cuts the face of the first epoch into patches and pools the points of both epochs in each.
pub(crate) fn pool_into_patches(
    pair: &LocalPair,
    motion: &InverseMotion,
    window: &InverseMotion,
    noise: &SurfaceNoise,
    layout: &Layout,
) -> Patches {
    let second: Vec<[f64; 3]> = pair.second_moved_back(motion, window).collect();
    let epochs = [&pair.first, &second];
    let [first, moving] = [0, 1].map(|e| epochs[e].len() as f64 / noise.sigma_m[e].powi(2));
    let anchor = match moving > HEAVIER * first {
        true => motion.shift_in_face(),
        false => [0.0; 2],
    };
    let Some(cuts) = Cuts::new(&pair.first, anchor, layout) else {
        return Patches {
            list: Vec::new(),
            overlap: 0.0,
        };
    };
    let mut list: Vec<PatchPoints> = (0..cuts.count[0] * cuts.count[1])
        .map(|patch| PatchPoints {
            grid: cuts.grid(patch, layout.cell_m),
            epochs: [Vec::new(), Vec::new()],
            roughness: pair.noise.roughness,
        })
        .collect();

    let mut compare = CellSums::new(cuts.low, cuts.high, COMPARE_CELLS * layout.cell_m);
    for (epoch, points) in epochs.into_iter().enumerate() {
        for p in points {
            compare.count(epoch, p);
            if let Some(patch) = cuts.patch_at(p) {
                let PatchPoints { grid, epochs, .. } = &mut list[patch];
                epochs[epoch].push(grid.point(*p));
            }
        }
    }

    list.retain(|patch| patch.epochs.iter().all(|o| o.len() >= PATCH_POINTS));
    Patches {
        list,
        overlap: compare.overlap(),
    }
}

/// How a face is cut into patches of equal size.
struct Cuts {
    low: [f64; 2],
    high: [f64; 2],
    count: [usize; 2],
    /// Sides of a patch, metres.
    step: [f64; 2],
}

impl Cuts {
    /// `None` without points. `anchor`: by how much the grid of cells is moved, up to whole cells.
    fn new(face: &[[f64; 3]], anchor: [f64; 2], layout: &Layout) -> Option<Self> {
        let margin = MARGIN_CELLS * layout.cell_m;
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for p in face {
            for a in 0..2 {
                low[a] = low[a].min(p[a] - margin);
                high[a] = high[a].max(p[a] + margin);
            }
        }
        for a in 0..2 {
            let to_anchor = (anchor[a] / layout.cell_m).fract() * layout.cell_m;
            low[a] += to_anchor;
            high[a] += to_anchor;
        }
        let side = layout.patch_cells.max(LEAST_CELLS) as f64 * layout.cell_m;
        let count = [0, 1].map(|a| ((high[a] - low[a]) / side).ceil().max(1.0) as usize);
        (!face.is_empty()).then(|| Self {
            low,
            high,
            count,
            step: [0, 1].map(|a| (high[a] - low[a]) / count[a] as f64),
        })
    }

    fn patch_at(&self, p: &[f64; 3]) -> Option<usize> {
        let at = [0, 1].map(|a| ((p[a] - self.low[a]) / self.step[a]).floor());
        let is_inside = (0..2).all(|a| at[a] >= 0.0 && at[a] < self.count[a] as f64);
        is_inside.then(|| at[1] as usize * self.count[0] + at[0] as usize)
    }

    fn grid(&self, patch: usize, cell_m: f64) -> PatchGrid {
        let corner = [
            self.low[0] + (patch % self.count[0]) as f64 * self.step[0],
            self.low[1] + (patch / self.count[0]) as f64 * self.step[1],
        ];
        PatchGrid::new(
            corner,
            [corner[0] + self.step[0], corner[1] + self.step[1]],
            cell_m,
        )
    }
}
