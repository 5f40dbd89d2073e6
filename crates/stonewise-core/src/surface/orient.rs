//! Which side of a surface is outside.

use super::SurfaceCell;
use super::outside::Outside;
use super::signs::{consistent_groups, neighbours};
use super::surface_cells;
use crate::cloud::{GridIndex, TileSource};
use crate::components::components;
use crate::progress::{Interrupted, Progress};
use nalgebra::Point3;

/// Cosine of the angle to the vertical below which a cell is a wall, and above which it is level.
const STEEP: f64 = 0.5;
const LEVEL: f64 = 0.85;
/// Skewness below which nothing is said: about twice its standard error for a cell of 150 points.
const LEAST_SKEWNESS: f64 = 0.3;
/// Rise of a normal below which a wall counts as plumb.
const LEAST_BATTER: f64 = 0.05;
/// Natural logarithm of the odds that one independent piece of evidence is right: nine of ten level surfaces
/// near the ground are seen from above; skewness is negative outwards in five of eight cells (fountain 0.71,
/// portal 0.60, scans of dam_small 0.68); walls lean back in three of five.
const LEVEL_ODDS: f64 = 2.2;
const JOINTS_ODDS: f64 = 0.5;
const BATTER_ODDS: f64 = 0.4;
/// Evidence from which on the outside is known: odds of 99 to 1.
pub const SURE_OF_OUTSIDE: f64 = 4.6;
/// Height above the lowest surfaces up to which level ones are seen from above, metres: eyes and scanners on
/// tripods are higher. Above, soffits are seen from below.
const EYE_M: f64 = 1.5;
/// Area that counts as one independent piece of evidence, square metres: neighbours share what the surface
/// looks like.
const INDEPENDENT_M2: f64 = 0.6;
/// A ledge, however small, is at least this part of an independent piece: treads of one flight are alike.
const LEDGE: f64 = 1.0 / 3.0;
/// Edge of the cells that decide about signs, as a part of those that are asked for: edges and treads show in
/// small cells.
const FINE: f64 = 0.6;
/// Part of the surface that small cells must show; where noise is as wide as they are, they show less.
const FINE_SHARE: f64 = 0.7;

/// What speaks for the outside that was chosen: natural logarithms of odds; negative speaks against it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Scanners stand outside.
    pub scanners: f64,
    /// Low level surfaces (ground, ledges, treads) are seen from above.
    pub level: f64,
    /// Joints lie behind the faces of stones.
    pub joints: f64,
    /// Walls lean back.
    pub batter: f64,
}

impl Evidence {
    /// All together.
    pub fn total(&self) -> f64 {
        // Where scanners stood is known, the rest is circumstantial.
        if self.scanners == 0.0 {
            self.level + self.joints + self.batter
        } else {
            self.scanners
        }
    }

    fn reversed(self) -> Self {
        Self {
            scanners: -self.scanners,
            level: -self.level,
            joints: -self.joints,
            batter: -self.batter,
        }
    }
}

/// Surface cells whose normals point outside.
#[derive(Clone, Debug)]
pub struct Orientation {
    /// The cells.
    pub cells: Vec<SurfaceCell>,
    /// What decided about the largest connected surface.
    pub evidence: Evidence,
}

impl Orientation {
    /// Whether the outside is beyond doubt.
    pub fn is_sure(&self) -> bool {
        self.evidence.total() >= SURE_OF_OUTSIDE
    }
}

/// The surface cells of a cloud with an edge of `cell_m` metres, turned outside ([`orient`]). Smaller cells decide
/// about the signs where they show the surface as well.
///
/// # Errors
/// A tile cannot be read, interruption.
pub fn oriented_surface<T: TileSource, E: From<T::Error> + From<Interrupted>>(
    tiles: &T,
    cell_m: f64,
    scanners: &[Point3<f64>],
    progress: &dyn Progress,
) -> Result<Orientation, E> {
    let cells = surface_cells::<T, E>(tiles, cell_m, progress)?;
    let fine = surface_cells::<T, E>(tiles, FINE * cell_m, progress)?;
    if (fine.len() as f64) * FINE * FINE < FINE_SHARE * cells.len() as f64 {
        return Ok(orient(cells, cell_m, scanners));
    }
    let found = orient(fine, FINE * cell_m, scanners);
    let outside = Outside::of(&found.cells);
    let turned = |cell: SurfaceCell| match outside.orient(&cell.centroid, cell.normal) == cell.normal {
        true => cell,
        false => cell.flipped(),
    };
    Ok(Orientation {
        cells: cells.into_iter().map(turned).collect(),
        evidence: found.evidence,
    })
}

/// Turns the normals of all cells of an edge of `cell_m` metres outside; `scanners`: positions from which the
/// surface was measured, world frame, none where they are not known.
///
/// Cells that touch each other get consistent signs first. Then each connected surface is turned to the side
/// that the evidence favours; a small one whose own evidence is weak follows the nearest cell of the largest.
///
/// Cost: 26 neighbours a cell, sorted.
pub fn orient(mut cells: Vec<SurfaceCell>, cell_m: f64, scanners: &[Point3<f64>]) -> Orientation {
    let groups = consistent_groups(&mut cells);
    let mut decided = Evidence::default();
    let Some((largest, others)) = groups.split_first() else {
        return Orientation {
            cells,
            evidence: decided,
        };
    };
    let found = evidence_of(&cells, largest, cell_m, scanners);
    decided = turn(&mut cells, largest, found, found.total() < 0.0);
    let centroids: Vec<Point3<f64>> = largest.iter().map(|&i| cells[i].centroid).collect();
    let index = GridIndex::for_nearest(&centroids);
    for group in others {
        let found = evidence_of(&cells, group, cell_m, scanners);
        let is_inward = match found.total().abs() >= SURE_OF_OUTSIDE {
            true => found.total() < 0.0,
            false => opposes(&cells, group, largest, &index),
        };
        turn(&mut cells, group, found, is_inward);
    }
    Orientation {
        cells,
        evidence: decided,
    }
}

/// Turns all cells of a group round where their normals point inward; the evidence after that.
fn turn(cells: &mut [SurfaceCell], group: &[usize], found: Evidence, is_inward: bool) -> Evidence {
    if !is_inward {
        return found;
    }
    for &i in group {
        cells[i] = cells[i].flipped();
    }
    found.reversed()
}

/// Whether most normals of a group oppose those of the nearest cells of the largest group; `index`: of its
/// centroids.
fn opposes(cells: &[SurfaceCell], group: &[usize], largest: &[usize], index: &GridIndex) -> bool {
    // A few cells of the group say what all would.
    let step = group.len().div_ceil(50);
    let cosines = group.iter().step_by(step).filter_map(|&i| {
        let (nearest, _) = index.nearest(&cells[i].centroid, f64::INFINITY)?;
        Some(cells[i].normal.dot(&cells[largest[nearest]].normal))
    });
    cosines.sum::<f64>() < 0.0
}

fn evidence_of(cells: &[SurfaceCell], group: &[usize], cell_m: f64, scanners: &[Point3<f64>]) -> Evidence {
    let all = || group.iter().map(|&i| &cells[i]);
    let walls = || all().filter(|c| c.normal.z.abs() < STEEP);
    let facing = |c: &SurfaceCell| {
        let to = scanners.iter().map(|s| s - c.centroid);
        let nearest = to.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
        nearest.map_or(0.0, |to| c.normal.dot(&to))
    };
    let lowest_m = low_end(all().map(|c| c.centroid.z).collect());
    let is_low = |c: &&SurfaceCell| c.centroid.z < lowest_m + EYE_M && c.normal.z.abs() > LEVEL;
    let level: Vec<SurfaceCell> = all().filter(is_low).copied().collect();
    let a_cell = cell_m * cell_m / INDEPENDENT_M2;
    let skewness = walls().map(|c| -c.skewness).filter(|s| s.abs() > LEAST_SKEWNESS);
    let rise = walls().map(|c| c.normal.z).filter(|z| z.abs() > LEAST_BATTER);
    Evidence {
        scanners: LEVEL_ODDS * majority(all().map(facing)),
        level: LEVEL_ODDS * ledges_upward(&level, a_cell),
        joints: JOINTS_ODDS * a_cell * majority(skewness),
        batter: BATTER_ODDS * a_cell * majority(rise),
    }
}

/// How many more pieces of level surfaces are seen from above than from below; `a_cell`: pieces in a cell.
fn ledges_upward(level: &[SurfaceCell], a_cell: f64) -> f64 {
    let ledge = |cells: Vec<usize>| {
        let count = cells.len() as f64;
        let share = majority(cells.iter().map(|&i| level[i].normal.z)) / count;
        share * LEDGE.max(a_cell * count)
    };
    components(&neighbours(level)).into_iter().map(ledge).sum()
}

/// The fiftieth part from below: stray points lie lower than anything.
fn low_end(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 50).copied().unwrap_or(0.0)
}

/// How many more values are positive than negative.
fn majority(values: impl Iterator<Item = f64>) -> f64 {
    let sign = |value: f64| if value == 0.0 { 0.0 } else { value.signum() };
    values.map(sign).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, MemoryTiles};
    use crate::progress::Silent;
    use crate::surface::surface_cells;
    use nalgebra::{Rotation3, Vector3};

    /// A wall of 6 x 3 m in the plane y = 0 that faces -y, with joints 2 cm deep and 4 cm wide every 50 cm,
    /// which may lean back.
    fn masonry(lean: f64) -> Vec<Point3<f64>> {
        let joint = |v: f64| v.rem_euclid(0.5) < 0.04;
        (0..300)
            .flat_map(|i| (0..150).map(move |j| (0.02 * f64::from(i) + 0.007, 0.02 * f64::from(j) + 0.003)))
            .map(|(x, z)| {
                let depth = if joint(x) || joint(z) {
                    0.02
                } else {
                    0.002 * (9.0 * x + 5.0 * z).sin()
                };
                Point3::new(x, depth + lean * z, z)
            })
            .collect()
    }

    fn ground() -> Vec<Point3<f64>> {
        (0..300)
            .flat_map(|i| (0..100).map(move |j| (0.02 * f64::from(i), -0.02 * f64::from(j))))
            .map(|(x, y)| Point3::new(x, y - 0.01, 0.005 * (40.0 * x).sin() * (31.0 * y).cos()))
            .collect()
    }

    fn oriented(points: Vec<Point3<f64>>, scanners: &[Point3<f64>]) -> Orientation {
        let tiles = MemoryTiles::new([Cloud::from_world(Point3::origin(), points)]);
        let cells = surface_cells::<_, Box<dyn std::error::Error + Send + Sync>>(&tiles, 0.5, &Silent);
        orient(cells.unwrap(), 0.5, scanners)
    }

    #[test]
    fn joints_and_batter_show_the_outside_of_a_wall_alone() {
        for lean in [0.0, 0.2] {
            let found = oriented(masonry(lean), &[]);
            assert!(
                found.cells.len() > 60 && found.cells.iter().all(|c| c.normal.y < -0.9),
                "{lean}"
            );
            assert!(found.evidence.joints > 1.0, "{:?}", found.evidence);
            assert_eq!(found.evidence.batter > 1.0, lean > 0.0);
        }
    }

    #[test]
    fn the_ground_lies_before_a_wall() {
        // A wall without joints says nothing itself.
        let plain = masonry(0.0).into_iter().map(|p| Point3::new(p.x, 0.0, p.z));
        let found = oriented(plain.chain(ground()).collect(), &[]);
        assert!(found.evidence.level > 2.0);
        for cell in &found.cells {
            let outside = if cell.centroid.z > 0.3 {
                -Vector3::y()
            } else {
                Vector3::z()
            };
            assert!(
                cell.centroid.z < 0.3 && cell.centroid.y > -0.5 || cell.normal.dot(&outside) > 0.9,
                "{cell:?}"
            );
        }
    }

    /// Eight steps, 20 cm high and 40 cm deep, go down towards -y; nothing else says where outside is.
    #[test]
    fn treads_are_seen_from_above() {
        let places =
            (0..150).flat_map(|i| (0..480).map(move |j| (0.02 * f64::from(i) + 0.01, 0.01 * f64::from(j))));
        let steps = places.map(|(x, way)| {
            let (step, rest) = ((way / 0.6).floor(), way.rem_euclid(0.6));
            let [y, z] = [0.4 * step + (rest - 0.2).max(0.0), 0.2 * step + rest.min(0.2)];
            Point3::new(x, y + 0.005, z + 0.005)
        });
        let tiles = MemoryTiles::new([Cloud::from_world(Point3::origin(), steps)]);
        let cells = surface_cells::<_, Box<dyn std::error::Error + Send + Sync>>(&tiles, 0.1, &Silent);
        let found = orient(cells.unwrap(), 0.1, &[]);
        assert!(found.is_sure(), "{:?}", found.evidence);
        let outside = Vector3::new(0.0, -1.0, 1.0);
        assert!(found.cells.iter().all(|c| c.normal.dot(&outside) > 0.0));
    }

    #[test]
    fn scanners_overrule_what_the_surface_looks_like() {
        let behind = [Point3::new(3.0, 8.0, 1.5)];
        let found = oriented(masonry(0.2), &behind);
        assert!(found.is_sure() && found.cells.iter().all(|c| c.normal.y > 0.9));
    }

    /// A closed round tower, its cells with signs at random, seen from the middle: all normals point inward,
    /// wherever the axes of the world lie.
    #[test]
    fn signs_are_consistent_around_a_tower() {
        let turn = Rotation3::from_euler_angles(0.3, -0.4, 1.1);
        let points =
            (0..800).flat_map(|i| (0..100).map(move |j| (0.00785 * f64::from(i), 0.02 * f64::from(j))));
        let points: Vec<_> = points
            .map(|(angle, z)| turn * Point3::new(3.0 * angle.cos(), 3.0 * angle.sin(), z))
            .collect();
        let found = oriented(points, &[turn * Point3::new(0.0, 0.0, 1.0)]);
        assert!(found.cells.len() > 100);
        for cell in &found.cells {
            let local = turn.inverse() * cell.centroid;
            let inward = turn * -Vector3::new(local.x, local.y, 0.0).normalize();
            assert!(cell.normal.dot(&inward) > 0.9, "{cell:?}");
        }
    }
}
