//! The face of a stone cut into patches, each with the points of both epochs.

use super::cells::{COMPARE_CELLS, CellSums};
use super::layout::Layout;
use super::local_motion::{LocalMotion, Still};
use super::local_pair::LocalPair;
use super::patch_grid::{PatchGrid, WeightedPoint};
use super::surface_noise::SurfaceNoise;

/// Points in each epoch that a patch needs: twice the unknowns of a plane, for a fit whose outliers can be detected.
const PATCH_POINTS: usize = 12;
/// Width by which a face is widened, in cells: points that noise moved beyond the outline of the face still
/// count.
const MARGIN_CELLS: f64 = 2.0;
/// Factor by which the second epoch's points must outweigh those of the first for the surface to lie in the second
/// epoch. The fit depends on where points lie between the cells, most for sharp points: if these moved over the cells,
/// some motions would seem likelier by that alone.
const HEAVIER: f64 = 2.0;
/// Shortest side of a patch, in cells: a cubic spline's four coefficients.
const LEAST_CELLS: usize = 4;

/// A piece of the face with the points of both epochs.
pub(crate) struct PatchPoints {
    pub grid: PatchGrid,
    pub epochs: [Vec<WeightedPoint>; 2],
    /// Roughness of the stone over that of most.
    pub roughness: f64,
    /// Whether its column and row add to an odd number, as those of the dark squares of a chessboard.
    pub is_dark: bool,
}

pub(crate) struct Patches {
    pub list: Vec<PatchPoints>,
    pub overlap: f64,
    /// Whose points stay where they are.
    pub still: Still,
}

/// Cuts the face of one epoch into patches and pools the points of both epochs in each, those of the other epoch moved.
pub(crate) fn pool_into_patches(
    pair: &LocalPair,
    motion: &LocalMotion,
    window: &LocalMotion,
    noise: &SurfaceNoise,
    layout: &Layout,
) -> Patches {
    let mut second = pair.second_in(window);
    let weight = |count: usize, epoch: usize| count as f64 / noise.sigma_m[epoch].powi(2);
    let still = match weight(second.len(), 1) > HEAVIER * weight(pair.first.len(), 0) {
        true => Still::Second,
        false => Still::First,
    };
    let mut first: Vec<(u32, [f64; 3])> = (0..).zip(pair.first.iter().copied()).collect();
    match still {
        Still::First => second.iter_mut().for_each(|(_, q)| *q = motion.undo(q)),
        Still::Second => first.iter_mut().for_each(|(_, p)| *p = motion.apply(p)),
    }
    let of_first = widened(&first, layout);
    let face = match still {
        Still::First => of_first,
        Still::Second => widened(&second, layout),
    };
    let (Some([low, high]), Some(face)) = (of_first, face) else {
        return Patches {
            list: Vec::new(),
            overlap: 0.0,
            still,
        };
    };
    let cuts = Cuts::new(face, layout);
    let count = cuts.count[0] * cuts.count[1];
    let mut list: Vec<PatchPoints> = (0..count)
        .map(|patch| PatchPoints {
            grid: cuts.grid(patch, layout.cell_m),
            // Patches in the middle of a face have more points than those at its rim.
            epochs: [&first, &second].map(|points| Vec::with_capacity(3 * points.len() / (2 * count))),
            roughness: pair.noise.roughness,
            is_dark: cuts.place(patch).iter().sum::<usize>() % 2 == 1,
        })
        .collect();

    let mut compare = CellSums::new(low, high, COMPARE_CELLS * layout.cell_m);
    for (epoch, points) in [&first, &second].into_iter().enumerate() {
        for (i, p) in points {
            compare.count(epoch, p);
            if let Some(patch) = cuts.patch_at(p) {
                let PatchPoints { grid, epochs, .. } = &mut list[patch];
                epochs[epoch].push(grid.point(*i, *p));
            }
        }
    }

    list.retain(|patch| patch.epochs.iter().all(|o| o.len() >= PATCH_POINTS));
    Patches {
        list,
        overlap: compare.overlap(),
        still,
    }
}

/// The corners of a face, widened; `None` without points.
fn widened(face: &[(u32, [f64; 3])], layout: &Layout) -> Option<[[f64; 2]; 2]> {
    let margin = MARGIN_CELLS * layout.cell_m;
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for (_, p) in face {
        for a in 0..2 {
            low[a] = low[a].min(p[a] - margin);
            high[a] = high[a].max(p[a] + margin);
        }
    }
    (!face.is_empty()).then_some([low, high])
}

/// How a face is cut into patches of equal size.
struct Cuts {
    low: [f64; 2],
    count: [usize; 2],
    /// Sides of a patch, metres.
    step: [f64; 2],
}

impl Cuts {
    fn new([low, high]: [[f64; 2]; 2], layout: &Layout) -> Self {
        let side = layout.patch_cells.max(LEAST_CELLS) as f64 * layout.cell_m;
        let count = [0, 1].map(|a| ((high[a] - low[a]) / side).ceil().max(1.0) as usize);
        Self {
            low,
            count,
            step: [0, 1].map(|a| (high[a] - low[a]) / count[a] as f64),
        }
    }

    /// Column and row of a patch.
    fn place(&self, patch: usize) -> [usize; 2] {
        [patch % self.count[0], patch / self.count[0]]
    }

    fn patch_at(&self, p: &[f64; 3]) -> Option<usize> {
        let at = [0, 1].map(|a| ((p[a] - self.low[a]) / self.step[a]).floor());
        let is_inside = (0..2).all(|a| at[a] >= 0.0 && at[a] < self.count[a] as f64);
        is_inside.then(|| at[1] as usize * self.count[0] + at[0] as usize)
    }

    fn grid(&self, patch: usize, cell_m: f64) -> PatchGrid {
        let place = self.place(patch);
        let corner = [0, 1].map(|a| self.low[a] + place[a] as f64 * self.step[a]);
        PatchGrid::new(
            corner,
            [corner[0] + self.step[0], corner[1] + self.step[1]],
            cell_m,
        )
    }
}
