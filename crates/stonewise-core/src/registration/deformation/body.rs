//! A part of the wall whose shape is judged: its stones, and the joint distribution of their motions.

use super::shared_errors::{SharedErrors, symmetric_root};
use crate::components::components;
use crate::geometry::lever;
use crate::id::StoneId;
use crate::linalg::{BlockFactor, BlockPattern, root};
use crate::registration::adjustment::JointMotions;
use crate::registration::adjustment::joint_motions::JointStone;
use crate::registration::modes::{less_rigid, main_modes};
use crate::registration::observers::JointErrors;
use crate::registration::octave_patches::octave_patches;
use nalgebra::{Matrix3, Matrix3xX, Point3, SMatrix, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Columns for the six unknowns of a rigid motion.
pub(super) type Matrix3x6 = SMatrix<f64, 3, 6>;

/// A part of the wall.
pub(super) struct Body<'a> {
    motions: &'a JointMotions,
    pub stones: Vec<BodyStone<'a>>,
    /// Pairs of neighbours, as indices into the stones.
    pub neighbours: Vec<[usize; 2]>,
    /// All errors that stones share.
    pub shared: SharedErrors,
    /// Those of points and of photos' poses alone.
    pub of_points: SharedErrors,
    /// The others, of the epochs: a column of each stone for each independent unknown of variance one, without what a
    /// rigid motion of all stones explains.
    pub of_epochs: Vec<Matrix3xX<f64>>,
}

/// A stone of it.
pub(super) struct BodyStone<'a> {
    pub id: StoneId,
    /// Whether it counts for the shape of the wall: it is not loose, and its part has stones enough.
    pub is_firm: bool,
    /// Node of the field.
    node: usize,
    pub joint: &'a JointStone,
    /// Its motion less the known error of the epoch, world, metres.
    pub displacement: Vector3<f64>,
    /// What its own observations say of that: information and vector.
    pub information: Matrix3<f64>,
    pub vector: Vector3<f64>,
    /// The displacement by a rigid motion about the middle of the body, rotations in metres at `arm_m`.
    pub lever: Matrix3x6,
    /// Covariance of what it shares with no other stone.
    own: Matrix3<f64>,
}

impl<'a> Body<'a> {
    /// All parts of at least this many stones that are not loose. Parts that are neighbours are one: only a crack
    /// parts them, and what lies on its other side has moved. Smaller parts go with a neighbour, and their stones count
    /// like loose ones.
    pub fn all(
        motions: &'a JointMotions,
        errors: Option<(&JointErrors, &[StoneId])>,
        least_stones: usize,
    ) -> Vec<Self> {
        let measured = || motions.stones.iter().flatten();
        let mut firm: BTreeMap<u32, usize> = BTreeMap::new();
        measured().for_each(|s| *firm.entry(s.body).or_default() += usize::from(!s.is_loose));
        let large: Vec<u32> = firm
            .into_iter()
            .filter(|(_, stones)| *stones >= least_stones)
            .map(|(body, _)| body)
            .collect();
        let part_of = |node: usize| Some(motions.stones[node].as_ref()?.body);
        let place = |part: u32| large.binary_search(&part).ok();
        let mut next = vec![Vec::new(); large.len()];
        let mut small: BTreeMap<u32, usize> = BTreeMap::new();

        for &(low, high) in &motions.edges {
            let (Some(low), Some(high)) = (part_of(low), part_of(high)) else {
                continue;
            };
            match (place(low), place(high)) {
                (Some(a), Some(b)) => {
                    next[a].push(b);
                    next[b].push(a);
                }
                (Some(a), None) => {
                    small.entry(high).or_insert(a);
                }
                (None, Some(b)) => {
                    small.entry(low).or_insert(b);
                }
                (None, None) => {}
            }
        }

        let of_wall = |wall: &Vec<usize>| {
            let beside = small.iter().filter(|(_, neighbour)| wall.contains(neighbour));
            let parts: BTreeMap<u32, bool> = wall
                .iter()
                .map(|&place| (large[place], true))
                .chain(beside.map(|(part, _)| (*part, false)))
                .collect();
            Self::new(motions, errors, &parts)
        };

        components(next.len(), |part| next[part].iter().copied())
            .iter()
            .map(of_wall)
            .collect()
    }

    /// `parts`: with whether their stones count.
    fn new(
        motions: &'a JointMotions,
        errors: Option<(&JointErrors, &[StoneId])>,
        parts: &BTreeMap<u32, bool>,
    ) -> Self {
        let of_body = |(node, stone): (usize, &'a Option<JointStone>)| {
            Some((node, stone.as_ref().filter(|s| parts.contains_key(&s.body))?))
        };
        let members: Vec<(usize, &JointStone)> =
            motions.stones.iter().enumerate().filter_map(of_body).collect();
        let count = members.len().max(1) as f64;
        let middle = Point3::from(members.iter().map(|(_, s)| s.place.coords).sum::<Vector3<f64>>() / count);
        let squares: f64 = members
            .iter()
            .map(|(_, s)| (s.place - middle).norm_squared())
            .sum();
        let arm_m = (squares / count).sqrt().max(f64::MIN_POSITIVE);
        let number: BTreeMap<StoneId, usize> = errors
            .iter()
            .flat_map(|(_, ids)| ids.iter().copied().zip(0..))
            .collect();

        let error_of = |id: StoneId| Some((errors?.0, *number.get(&id)?));
        let stone = |(node, joint): &(usize, &'a JointStone)| {
            let error = error_of(joint.id);
            let taken_off = error.map_or_else(Vector3::zeros, |(e, k)| e.mean_of_motions[k]);
            let off_points = error.map_or_else(Vector3::zeros, |(e, k)| e.mean[k]);
            let of_sources = error.map_or_else(Matrix3::zeros, |(e, k)| e.own[k]);
            let mut lever = lever(&(joint.place - middle));
            lever.fixed_columns_mut::<3>(3).unscale_mut(arm_m);
            let (information, vector) = joint.observed;
            BodyStone {
                id: joint.id,
                is_firm: !joint.is_loose && parts.get(&joint.body) == Some(&true),
                node: *node,
                joint,
                displacement: joint.displacement - taken_off,
                information,
                vector: vector - information * off_points,
                lever,
                own: joint.own + of_sources,
            }
        };

        let stones: Vec<BodyStone> = members.iter().map(stone).collect();
        let at: BTreeMap<usize, usize> = members.iter().map(|m| m.0).zip(0..).collect();
        let pair = |(low, high): &(usize, usize)| Some([*at.get(low)?, *at.get(high)?]);
        let mut shared = SharedErrors::none(stones.len());
        add_octaves(&mut shared, motions, &stones);
        if let Some(matching) = errors.and_then(|(errors, _)| errors.matching.as_ref()) {
            let root_of = |stone: &BodyStone| {
                error_of(stone.id).map_or_else(Matrix3::zeros, |(_, k)| root(&matching.covariances[k]))
            };
            let roots: Vec<Matrix3<f64>> = stones.iter().map(root_of).collect();
            add_patches(&mut shared, &stones, [0.5 * matching.length_m, 2.0], &roots);
        }
        if motions.poses.nrows() > 0 {
            shared.add_joint(&motions.poses, stones.iter().map(|s| s.joint.by_poses.clone()));
        }

        let of_points = shared.clone();
        let mut of_epochs = vec![Matrix3xX::zeros(0); stones.len()];
        if let Some((errors, _)) = errors {
            let root = symmetric_root(&errors.covariance);
            let column = |stone: &BodyStone| {
                let mut by = Matrix3xX::zeros(root.ncols());
                for (first, part) in error_of(stone.id).map_or(&[][..], |(e, k)| &e.rows[k]) {
                    by += part * root.rows(*first, 3);
                }
                by
            };
            let columns = less_rigid(
                stones.iter().map(|s| s.joint.place),
                stones.iter().map(column).collect(),
            );
            of_epochs = columns.map_or(of_epochs, |columns| main_modes(&columns));
            let row = |stone: &BodyStone| {
                let row = error_of(stone.id).map_or(&[][..], |(e, k)| &e.rows[k]);
                let columns = |(first, by): &(usize, Matrix3<f64>)| {
                    let (first, by) = (*first, *by);
                    (0..3).map(move |c| (first + c, by.column(c).into_owned()))
                };
                row.iter().flat_map(columns).collect()
            };
            shared.add_joint(&errors.covariance, stones.iter().map(row));
        }

        Self {
            motions,
            neighbours: motions.edges.iter().filter_map(pair).collect(),
            stones,
            shared,
            of_points,
            of_epochs,
        }
    }

    /// Distance of neighbours, metres.
    pub fn step_m(&self) -> f64 {
        self.motions.step_m
    }

    /// The pattern of the equations of the field. `None` where memory does not suffice.
    pub fn pattern(&self) -> Option<BlockPattern<9>> {
        BlockPattern::new(self.motions.stones.len(), &self.motions.edges)
    }

    /// The joint covariance of all displacements. `None` where memory or the numbers fail.
    pub fn covariance<'b>(&'b self, pattern: &'b BlockPattern<9>) -> Option<Covariance<'b>> {
        let factor = pattern.factor(&self.motions.information)?;
        let inverse = factor.selected_inverse()?;
        let diagonal = |(i, stone): (usize, &BodyStone)| {
            let by_field = &stone.joint.by_field;
            by_field * inverse.diagonal[stone.node] * by_field.transpose()
                + stone.own
                + self.shared.covariance(i)
        };
        let diagonal = self.stones.par_iter().enumerate().map(diagonal).collect();
        Some(Covariance {
            body: self,
            factor,
            diagonal,
        })
    }
}

/// Errors that points share over octaves of length, from twice the distance of neighbours up: see [`octave_patches`].
fn add_octaves(shared: &mut SharedErrors, motions: &JointMotions, stones: &[BodyStone]) {
    if stones.iter().all(|s| s.joint.octave.norm() == 0.0) {
        return;
    }
    let roots: Vec<Matrix3<f64>> = stones.iter().map(|s| s.joint.octave).collect();
    add_patches(shared, stones, [motions.step_m, motions.octaves], &roots);
}

/// Errors that stones of a patch share: from a length, over so many octaves; `roots`: of their covariances.
fn add_patches(
    shared: &mut SharedErrors,
    stones: &[BodyStone],
    [from_m, octaves]: [f64; 2],
    roots: &[Matrix3<f64>],
) {
    let places = stones.iter().map(|s| s.joint.place);
    for octave in octave_patches(places, from_m, octaves) {
        let row = |(root, patch): (&Matrix3<f64>, &usize)| {
            let patch = *patch;
            let columns = root * octave.share.sqrt();
            (0..3)
                .map(|c| (3 * patch + c, columns.column(c).into_owned()))
                .collect()
        };
        shared.add_units(3 * octave.count, roots.iter().zip(&octave.of_stones).map(row));
    }
}

/// The joint covariance of the displacements of a body's stones.
pub(super) struct Covariance<'a> {
    body: &'a Body<'a>,
    factor: BlockFactor<'a, 9>,
    /// Covariance of each stone, m^2.
    pub diagonal: Vec<Matrix3<f64>>,
}

impl Covariance<'_> {
    /// The covariance times these columns.
    pub fn times(&self, columns: &[Matrix3x6]) -> Vec<Matrix3x6> {
        let (body, nodes) = (self.body, self.body.motions.stones.len());
        let mut rhs = vec![SMatrix::<f64, 9, 6>::zeros(); nodes];
        for (stone, x) in body.stones.iter().zip(columns) {
            rhs[stone.node] = stone.joint.by_field.transpose() * x;
        }
        let solved = self.factor.solve(&rhs);
        let mut of_unknowns = body.shared.zeros::<6>();
        for (i, x) in columns.iter().enumerate() {
            body.shared.add_transposed(i, x, &mut of_unknowns);
        }
        let spread = body.shared.spread(&of_unknowns);
        let of_stone = |(i, (stone, x)): (usize, (&BodyStone, &Matrix3x6))| {
            stone.joint.by_field * solved[stone.node] + stone.own * x + body.shared.at(i, &spread)
        };
        body.stones
            .iter()
            .zip(columns)
            .enumerate()
            .map(of_stone)
            .collect()
    }
}
