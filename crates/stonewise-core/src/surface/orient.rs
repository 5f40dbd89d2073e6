//! Which side of a surface is outside.

use super::SurfaceCell;
use super::outside::Outside;
use super::signs::{PART_COSINE, Parts, contracted, neighbours, smooth_parts};
use super::surface_cells;
use crate::cloud::{GridIndex, TileSource};
use crate::components::components;
use crate::progress::{Interrupted, Progress};
use nalgebra::Point3;
use std::collections::{BTreeMap, BTreeSet};

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
/// Natural logarithm of the odds that the evidence of a piece of an edge is right: where two parts meet, both are
/// before the other or both behind.
const EDGE_ODDS: f64 = 1.1;
/// Natural logarithm of the odds that parallel parts that lie beside each other are seen from the same side, which
/// holds in 49 of 50 cases.
const BESIDE_ODDS: f64 = 3.9;
/// Part of the cells of one that may lie before or behind the other.
const OVERLAP: f64 = 0.25;
/// Distance up to which scanners show a side, as a factor of that of the nearest.
const NEAR: f64 = 1.5;
/// Distance up to which parts lie beside each other, metres.
const BESIDE_M: f64 = 1.5;
/// Evidence from which on the outside is known: odds of 20 to 1.
pub const SURE_OF_OUTSIDE: f64 = 3.0;
/// Height above the lowest surfaces up to which level ones are seen from above, metres: eyes and scanners on
/// tripods are higher. Above, soffits are seen from below.
const EYE_M: f64 = 1.5;
/// Part of the cells that may lie lower than any surface.
const STRAY: f64 = 0.02;
/// Area that counts as one independent piece of evidence, square metres: neighbours share what the surface
/// looks like.
const INDEPENDENT_M2: f64 = 0.6;
/// A ledge, however small, is at least this part of an independent piece: treads of one flight are alike.
const LEDGE: f64 = 1.0 / 3.0;
/// Part of the walls whose side may be less sure: railings, sides of buttresses, stray pieces.
const UNSURE: f64 = 0.4;
/// Edge of the cells that decide about signs, as a part of the edge of the cells returned: edges and treads show in
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

    fn plus(self, other: Self) -> Self {
        Self {
            scanners: self.scanners + other.scanners,
            level: self.level + other.level,
            joints: self.joints + other.joints,
            batter: self.batter + other.batter,
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
    /// The evidence of all parts for the outside that was chosen.
    pub evidence: Evidence,
    /// Natural logarithm of the odds that the outside is right, at least of three fifths of the walls (of all
    /// cells where there are none).
    pub odds: f64,
}

impl Orientation {
    /// Whether the outside is beyond doubt.
    pub fn is_sure(&self) -> bool {
        self.odds >= SURE_OF_OUTSIDE
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
        ..found
    })
}

/// Turns the normals of all cells of an edge of `cell_m` metres outside; `scanners`: positions from which the
/// surface was measured, world frame, none where they are not known.
///
/// Cells of smooth parts get consistent signs first. Then all evidence is added up, as logarithms of odds: that of
/// each part alone, ties between parts that meet at an edge, and ties between parallel parts that lie beside each
/// other.
///
/// Cost: 26 neighbours a cell, sorted.
pub fn orient(mut cells: Vec<SurfaceCell>, cell_m: f64, scanners: &[Point3<f64>]) -> Orientation {
    let mut parts = smooth_parts(&mut cells);
    // The sum of the ties along an edge is about its length in cells.
    let a_tie = EDGE_ODDS * cell_m / INDEPENDENT_M2.sqrt();
    for of_part in &mut parts.ties {
        of_part.values_mut().for_each(|tie| *tie *= a_tie);
    }
    let scene = Scene::of(&cells, cell_m, scanners);
    let evidence: Vec<Evidence> = parts.members.iter().map(|part| scene.evidence_of(part)).collect();
    scene.add_beside(&mut parts);
    let Parts {
        members: parts,
        mut ties,
        ..
    } = parts;

    // One node more stands for what points outside.
    let outside = parts.len();
    ties.push(BTreeMap::new());

    for (part, own) in evidence.iter().enumerate().filter(|(_, own)| own.total() != 0.0) {
        ties[part].insert(outside, own.total());
        ties[outside].insert(part, own.total());
    }

    let forest = contracted(ties);
    let (_, of_outside) = forest.root(outside);
    let (mut sum, mut odds) = (Evidence::default(), Vec::new());
    let shows_walls = cells.iter().any(is_wall);

    for (i, (part, own)) in parts.iter().zip(evidence).enumerate() {
        let is_inward = forest.root(i).1 != of_outside;
        sum = sum.plus(if is_inward { own.reversed() } else { own });
        let own_odds = forest.strength(i, outside).unwrap_or(0.0);
        let counts = |i: &&usize| !shows_walls || is_wall(&cells[**i]);
        odds.extend(part.iter().filter(counts).map(|_| own_odds));
        if is_inward {
            part.iter().for_each(|&i| cells[i] = cells[i].flipped());
        }
    }

    Orientation {
        cells,
        evidence: sum,
        odds: low_end(odds, UNSURE),
    }
}

/// What evidence is drawn from.
struct Scene<'a> {
    cells: &'a [SurfaceCell],
    cell_m: f64,
    scanners: &'a [Point3<f64>],
    /// Height of the lowest surfaces.
    lowest_m: f64,
}

impl<'a> Scene<'a> {
    fn of(cells: &'a [SurfaceCell], cell_m: f64, scanners: &'a [Point3<f64>]) -> Self {
        Self {
            cells,
            cell_m,
            scanners,
            lowest_m: low_end(cells.iter().map(|c| c.centroid.z).collect(), STRAY),
        }
    }

    /// The evidence of a part alone.
    fn evidence_of(&self, part: &[usize]) -> Evidence {
        let all = || part.iter().map(|&i| &self.cells[i]);
        let walls = || all().filter(|c| is_wall(c));
        let is_low = |c: &&SurfaceCell| c.centroid.z < self.lowest_m + EYE_M && c.normal.z.abs() > LEVEL;
        let level: Vec<SurfaceCell> = all().filter(is_low).copied().collect();
        let a_cell = self.cell_m * self.cell_m / INDEPENDENT_M2;
        let skewness = walls().map(|c| -c.skewness).filter(|s| s.abs() > LEAST_SKEWNESS);
        let rise = walls().map(|c| c.normal.z).filter(|z| z.abs() > LEAST_BATTER);
        Evidence {
            scanners: LEVEL_ODDS * majority(all().map(|c| self.facing(c))),
            level: LEVEL_ODDS * ledges_upward(&level, a_cell),
            joints: JOINTS_ODDS * a_cell * majority(skewness),
            batter: BATTER_ODDS * a_cell * majority(rise),
        }
    }

    /// On which side of a cell the scanners near it stand, those up to half as far again as the nearest: positive where
    /// its normal points, 0 where they stand on both sides, as before the flanks of a buttress.
    fn facing(&self, cell: &SurfaceCell) -> f64 {
        let to = || self.scanners.iter().map(|s| s - cell.centroid);
        let nearest_m = to().map(|to| to.norm()).fold(f64::INFINITY, f64::min);
        let near = to().filter(|to| to.norm() <= NEAR * nearest_m);
        let mut sides = near.map(|to| cell.normal.dot(&to).signum());
        match sides.next() {
            Some(side) if sides.all(|other| other == side) => side,
            _ => 0.0,
        }
    }

    /// Adds ties between parts that lie beside each other: parallel ones are seen from the same side, unless one
    /// lies behind the other, as the two faces of a railing or the flanks of a buttress do.
    fn add_beside(&self, parts: &mut Parts) {
        let Parts {
            members,
            of_cell,
            ties,
        } = parts;
        let centroids: Vec<Point3<f64>> = self.cells.iter().map(|c| c.centroid).collect();
        let index = GridIndex::new(&centroids, BESIDE_M);

        for (part, members) in members.iter().enumerate() {
            let mut sums: BTreeMap<usize, f64> = BTreeMap::new();
            let mut behind: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
            // A few cells of the part stand for all.
            let some = || members.iter().step_by(members.len().div_ceil(50));
            let mut count = 0.0;
            for &i in some() {
                let cell = &self.cells[i];
                index.within(&cell.centroid, BESIDE_M, |j, _| {
                    let other = &self.cells[j];
                    let (apart, cosine) = (other.centroid - cell.centroid, cell.normal.dot(&other.normal));
                    if of_cell[j] == part || cosine.abs() <= PART_COSINE {
                        return;
                    }
                    let across_m = cell.normal.dot(&apart).abs();
                    let beside_m = (apart.norm_squared() - across_m * across_m).max(0.0).sqrt();
                    if beside_m < self.cell_m {
                        behind.entry(of_cell[j]).or_default().insert(i);
                    } else if beside_m > across_m {
                        *sums.entry(of_cell[j]).or_default() += cosine;
                        count += 1.0;
                    }
                });
            }
            let overlaps = |other: &usize| {
                let cells = behind.get(other).map_or(0, BTreeSet::len);
                cells as f64 > OVERLAP * some().count() as f64
            };
            for (other, sum) in sums.into_iter().filter(|(other, _)| !overlaps(other)) {
                *ties[part].entry(other).or_default() += BESIDE_ODDS * sum / count;
                *ties[other].entry(part).or_default() += BESIDE_ODDS * sum / count;
            }
        }
    }
}

fn is_wall(cell: &SurfaceCell) -> bool {
    cell.normal.z.abs() < STEEP
}

/// How many more pieces of level surfaces are seen from above than from below; `a_cell`: pieces in a cell.
fn ledges_upward(level: &[SurfaceCell], a_cell: f64) -> f64 {
    let ledge = |cells: Vec<usize>| {
        let count = cells.len() as f64;
        let share = majority(cells.iter().map(|&i| level[i].normal.z)) / count;
        share * LEDGE.max(a_cell * count)
    };
    let next = neighbours(level);
    let ledges = components(next.len(), |cell| next[cell].iter().copied());
    ledges.into_iter().map(ledge).sum()
}

/// The value below which a part of all values lies; 0 without values.
fn low_end(mut values: Vec<f64>, part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (part * values.len() as f64) as usize;
    values.get(at).copied().unwrap_or(0.0)
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
    use rand::{RngExt, SeedableRng};

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
        // A wall without joints gives no evidence itself.
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

    /// Two buttresses 80 cm apart stand before a wall that leans back; as deep as one to three cells, they show
    /// edges badly.
    #[test]
    fn buttresses_face_as_the_wall_between_them() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for depth in [0.1, 0.15, 0.2, 0.3, 0.35] {
            let mut points = Vec::new();
            for _ in 0..60_000 {
                let [x, z] = [random.random_range(0.0..3.0), random.random_range(0.0..2.0)];
                let is_buttress = (x - 1.5_f64).abs() > 0.4 && (x - 1.5_f64).abs() < 1.2;
                let before = if is_buttress { depth } else { 0.0 };
                points.push([x, 0.2 * z - before + random.random_range(-0.01..0.01), z]);
                let sides = [0.3, 1.1, 1.9, 2.7];
                let at = random.random_range(0.0..depth);
                if random.random_range(0.0..1.5) < depth {
                    points.push([sides[random.random_range(0..4)], 0.2 * z - at, z]);
                }
                let [x, y] = [random.random_range(-1.0..4.0), random.random_range(-4.0..0.0)];
                points.push([x, y, random.random_range(-0.02..0.02)]);
            }
            let points = points.into_iter().map(Point3::from);
            let tiles = MemoryTiles::new([Cloud::from_world(Point3::origin(), points.collect::<Vec<_>>())]);
            let found =
                oriented_surface::<_, Box<dyn std::error::Error + Send + Sync>>(&tiles, 0.25, &[], &Silent);
            let found = found.unwrap();
            let faces = found.cells.iter().filter(|c| c.normal.y.abs() > 0.8);
            let faces: Vec<bool> = faces.map(|c| c.normal.y < 0.0).collect();
            assert!(faces.len() > 60 && faces.iter().all(|f| *f), "{depth}");
            assert!(found.is_sure(), "{depth}: {}", found.odds);
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

    /// Two buttresses before a wall: their inner flanks face each other and not the scanner that is nearer.
    #[test]
    fn flanks_face_away_from_their_buttress() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let mut points = Vec::new();
        for _ in 0..80_000 {
            let [x, z] = [random.random_range(-5.0..5.0_f64), random.random_range(0.0..2.0)];
            let y = if (2.0..3.0).contains(&x.abs()) { -1.5 } else { 0.0 };
            points.push(Point3::new(x, y + random.random_range(-0.005..0.005), z));
            let flank = [-3.0, -2.0, 2.0, 3.0][random.random_range(0..4)];
            let [y, z] = [random.random_range(-1.5..0.0), random.random_range(0.0..2.0)];
            points.push(Point3::new(flank, y, z));
        }
        let found = oriented(
            points,
            &[Point3::new(-6.0, -8.0, 1.0), Point3::new(6.0, -8.0, 1.0)],
        );
        let is_flank = |c: &&SurfaceCell| c.normal.x.abs() > 0.95;
        let flanks: Vec<bool> = found
            .cells
            .iter()
            .filter(is_flank)
            .map(|c| c.normal.x * c.centroid.x * (c.centroid.x.abs() - 2.5) > 0.0)
            .collect();
        assert!(
            flanks.len() > 20 && flanks.iter().all(|right| *right),
            "{flanks:?}"
        );
        let mut faces = found.cells.iter().filter(|c| c.normal.y.abs() > 0.95);
        assert!(faces.all(|c| c.normal.y < 0.0) && found.is_sure());
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
