//! The face of a stone cut into patches, each with the points of both epochs.

use super::cells::{COMPARE_CELLS, CellSums};
use super::layout::Layout;
use super::local_motion::{LocalMotion, Still};
use super::local_pair::LocalPair;
use super::patch_grid::{Observed, PatchGrid, WeightedPoint};
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
}

impl PatchPoints {
    /// The points of each epoch.
    pub fn points(&self) -> [&[WeightedPoint]; 2] {
        let [first, second] = &self.epochs;
        [first, second]
    }

    /// Normal equations of the patch's coefficients by these points, with their weights.
    pub fn observed(&self, noise: &SurfaceNoise) -> Observed {
        self.grid.observed(self.points(), noise)
    }
}

/// Which patches of a face are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PatchChoice {
    All,
    /// If there are more than two patches, those on one colour of a chessboard: the colour with more patches.
    EverySecond,
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
    choice: PatchChoice,
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
    let mut compare = CellSums::new(low, high, COMPARE_CELLS * layout.cell_m);
    // For each patch and epoch, the indices of its points in that epoch's list.
    let mut places = vec![[Vec::new(), Vec::new()]; cuts.count[0] * cuts.count[1]];
    for (epoch, points) in [&first, &second].into_iter().enumerate() {
        for (place, (_, p)) in points.iter().enumerate() {
            compare.count(epoch, p);
            if let Some(patch) = cuts.patch_at(p) {
                places[patch][epoch].push(place);
            }
        }
    }

    let is_seen = |patch: &usize| places[*patch].iter().all(|p| p.len() >= PATCH_POINTS);
    let chosen = cuts.chosen((0..places.len()).filter(is_seen).collect(), choice);
    let of_patch = |patch: usize| {
        let grid = cuts.grid(patch, layout.cell_m);
        let epochs = [(&first, 0), (&second, 1)].map(|(points, epoch)| {
            let of_place = |place: &usize| grid.point(points[*place].0, points[*place].1);
            places[patch][epoch].iter().map(of_place).collect()
        });
        PatchPoints { grid, epochs }
    };
    Patches {
        list: chosen.into_iter().map(of_patch).collect(),
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

    /// Those of `patches` that are used.
    fn chosen(&self, mut patches: Vec<usize>, choice: PatchChoice) -> Vec<usize> {
        let count = patches.len();
        match choice {
            PatchChoice::EverySecond if count > 2 => {
                let is_dark = |patch: &usize| self.place(*patch).iter().sum::<usize>() % 2 == 1;
                let are_dark = 2 * patches.iter().filter(|patch| is_dark(patch)).count() > count;
                patches.retain(|patch| is_dark(patch) == are_dark);
                patches
            }
            _ => patches,
        }
    }

    fn patch_at(&self, p: &[f64; 3]) -> Option<usize> {
        let at = [0, 1].map(|a| (p[a] - self.low[a]) / self.step[a]);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::stone_vector::StoneVector;

    /// A flat face of 1 x 0.8 m, points every centimetre in both epochs: six by five patches of 18 cells of a
    /// centimetre.
    fn chosen(choice: PatchChoice) -> Vec<PatchPoints> {
        let points: Vec<[f64; 3]> = (0..8000)
            .map(|k| [0.01 * f64::from(k % 100), 0.01 * f64::from(k / 100), 0.0])
            .collect();
        let noise = SurfaceNoise {
            sigma_m: [0.001; 2],
            tau_m: 0.001,
        };
        let layout = Layout {
            cell_m: 0.01,
            patch_cells: 18,
            outlier_sigmas: 3.5,
        };
        let still = LocalMotion::new(&StoneVector::zeros());
        let pair = LocalPair::of_points(points.clone(), points);
        pool_into_patches(&pair, &still, &still, &noise, &layout, choice).list
    }

    fn corner(patch: &PatchPoints) -> [i64; 2] {
        patch.grid.low().map(|x| (x * 1e6).round() as i64)
    }

    fn indices(patch: &PatchPoints, epoch: usize) -> Vec<u32> {
        patch.epochs[epoch].iter().map(|p| p.index).collect()
    }

    #[test]
    fn each_point_lies_in_one_patch_and_choices_leave_patches_as_they_are() {
        let all = chosen(PatchChoice::All);
        assert_eq!(all.len(), 30);
        for epoch in 0..2 {
            let mut found: Vec<u32> = all.iter().flat_map(|patch| indices(patch, epoch)).collect();
            found.sort_unstable();
            assert_eq!(found, (0..8000).collect::<Vec<u32>>());
        }
        let half = chosen(PatchChoice::EverySecond);
        assert_eq!(half.len(), 15);
        for patch in &half {
            let same = all.iter().find(|other| corner(other) == corner(patch)).unwrap();
            assert_eq!(indices(same, 1), indices(patch, 1));
        }
        // No two of every second patch share a side: corners of neighbours differ along both axes.
        for (k, a) in half.iter().enumerate() {
            for b in &half[k + 1..] {
                let apart = [0, 1].map(|axis| (corner(a)[axis] - corner(b)[axis]).abs());
                assert!(
                    apart[0].min(apart[1]) > 0 || apart[0].max(apart[1]) > 250_000,
                    "{apart:?}"
                );
            }
        }
    }
}
