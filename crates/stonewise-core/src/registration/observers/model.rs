//! The unknown errors of the sources, and their prior.

use super::components::{MergedDrift, ObserverComponents, SensorClass, Stretch};
use super::observation::Observation;
use super::sight::{Sight, Source, StablePlane, Target};
use crate::linalg::DenseFactor;
use crate::statistics::upper_median;
use crate::switches::where_on;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Point3, Vector3};
use std::collections::BTreeMap;

/// Sights for each knot of a source's drift, and the least and most knots.
const SIGHTS_PER_KNOT: usize = 8;
const KNOTS: [usize; 2] = [4, 20];
/// Distance of the knots along an epoch whose files keep no sources apart, metres, and the most of them.
const MERGED_KNOT_M: f64 = 2.0;
const MOST_KNOTS: usize = 200;
/// Smallest share of a drift's variance by which neighbouring knots differ: keeps the prior's matrix
/// invertible.
const KNOT_NUGGET: f64 = 1e-6;
/// An observation whose squared residual per difference exceeds this loses weight; cells of stable areas lose
/// it earlier, because an edge of a building is worth less than a stone.
const MISFIT: f64 = 9.0;
const CELL_MISFIT: f64 = 4.0;
/// Standard deviation that stands for none, metres.
const LEAST_M: f64 = 1e-7;

/// Where the unknowns of a source stand, and how its sights depend on them.
///
/// Per source: translation (3), rotation about the middle of its sights (3, in metres at `radius_m` from it),
/// and its drift at each knot (3 each).
#[derive(Clone, Debug)]
struct Block {
    first: usize,
    epoch: usize,
    /// Whether it is the only one of its epoch: the whole epoch, if files keep no sources apart.
    is_alone: bool,
    middle: Point3<f64>,
    radius_m: f64,
    /// Direction along which places are ordered where times cannot order them.
    along: Option<Vector3<f64>>,
    knots: Vec<f64>,
}

/// All unknowns: the blocks of the sources, then the error of the later epoch as a whole (3), then the stretch
/// of what sources show of the stones (3, where the class of the sensor has one), then what each source gets
/// wrong on each plane of the stable areas (3 each).
#[derive(Clone, Debug)]
pub(super) struct Unknowns {
    /// Block of each source; sources of one survey share theirs.
    blocks: Vec<Block>,
    of_source: Vec<usize>,
    epochs: Vec<usize>,
    whole: usize,
    /// First unknown of the stretch about the sources' middles (shared, and of each epoch), with the standard
    /// deviations of its prior.
    stretch: Option<(usize, Stretch)>,
    /// First unknown of each plane and block.
    planes: BTreeMap<(StablePlane, usize), usize>,
}

/// Standard deviations of the prior, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    pub translation_m: f64,
    pub rotation_m: f64,
    pub drift_m: f64,
    pub drift_length: f64,
    /// Covariance of the error of the later epoch against the reference, as a whole, m^2; 0: none.
    pub whole: Matrix3<f64>,
    /// Standard deviation of a source's error on a plane of the stable areas, metres.
    pub plane_m: f64,
    /// Drift of an epoch whose files keep no sources apart, along the wall; `None`: that of a source.
    pub merged: Option<MergedDrift>,
}

impl Prior {
    /// Where no planes are looked at.
    pub fn new(components: &ObserverComponents, whole_m: f64) -> Self {
        Self::with_planes(components, Matrix3::identity() * (whole_m * whole_m), LEAST_M)
    }

    pub fn with_planes(components: &ObserverComponents, whole: Matrix3<f64>, plane_m: f64) -> Self {
        Self {
            translation_m: components.translation_m,
            rotation_m: components.rotation_m,
            drift_m: where_on("obs_drift", components.drift_m, 1e-6),
            drift_length: components.drift_length,
            whole,
            plane_m,
            merged: None,
        }
    }

    /// Standard deviation and correlation length of a block's drift at its knots, the length in their unit.
    fn drift(&self, block: &Block) -> (f64, f64) {
        match self.merged {
            Some(merged) if block.is_alone => (merged.sd_m.max(LEAST_M), merged.length_m),
            _ => (self.drift_m, self.drift_length * block.duration()),
        }
    }
}

/// A row of the design: coefficients of a world displacement, block by block of three unknowns.
pub(super) type Row = Vec<(usize, Matrix3<f64>)>;

impl Unknowns {
    /// The unknowns of these sources, which see these sights.
    pub fn new(sources: &[Source], sights: &[Sight], class: SensorClass) -> Self {
        let mut blocks = Vec::new();
        let mut of_source = vec![0; sources.len()];
        let mut first = 0;
        let blocks_of = |epoch| {
            let own = sources.iter().filter(|s| s.same_as.is_none());
            own.filter(|s| s.epoch == epoch).count()
        };
        for (s, source) in sources.iter().enumerate() {
            if let Some(same) = source.same_as {
                of_source[s] = of_source[same];
                continue;
            }
            let is_seen = |x: &&Sight| sources[x.source].same_as.unwrap_or(x.source) == s;
            let seen: Vec<&Sight> = sights.iter().filter(is_seen).collect();
            let is_alone = blocks_of(source.epoch) == 1;
            let block = Block::new(first, &seen, source, is_alone);
            first += 6 + 3 * block.knots.len();
            of_source[s] = blocks.len();
            blocks.push(block);
        }
        Self {
            blocks,
            of_source,
            epochs: sources.iter().map(|s| s.epoch).collect(),
            whole: first,
            stretch: class.stretch().map(|sd| (first + 3, sd)),
            planes: BTreeMap::new(),
        }
    }

    /// Adds the errors of the sources on the planes of these observations.
    pub fn with_planes(mut self, observations: &[Observation]) -> Self {
        for sight in observations.iter().flat_map(|o| &o.sights) {
            let next = self.count();
            if let Some(plane) = sight.plane() {
                let key = (plane, self.of_source[sight.source]);
                self.planes.entry(key).or_insert(next);
            }
        }
        self
    }

    pub fn count(&self) -> usize {
        let stretch = if self.stretch.is_some() { 3 } else { 0 };
        self.whole + 3 + stretch + 3 * self.planes.len()
    }

    /// First unknown of a source's translation.
    pub fn translation(&self, source: usize) -> usize {
        self.blocks[self.of_source[source]].first
    }

    /// First unknown of the later epoch's error as a whole.
    pub fn whole(&self) -> usize {
        self.whole
    }

    /// Dimensionless stretch in the face, one value per epoch: each source is stretched about the middle of
    /// what it sees; `mean`: the unknowns. `None` where the model has none.
    pub fn stretches(&self, mean: &DVector<f64>) -> Option<[f64; 2]> {
        let (first, _) = self.stretch?;
        Some([1, 2].map(|of_epoch| mean[first] + mean[first + of_epoch]))
    }

    /// How a sight's error depends on the unknowns.
    pub fn row(&self, sight: &Sight) -> Row {
        let block = &self.blocks[self.of_source[sight.source]];
        let arm = (sight.place - block.middle) / block.radius_m;
        let mut row = vec![
            (block.first, Matrix3::identity()),
            (block.first + 3, -arm.cross_matrix()),
        ];
        for (k, weight) in block.between(block.order(sight)) {
            row.push((block.first + 6 + 3 * k, Matrix3::identity() * weight));
        }
        if self.epochs[sight.source] == 1 {
            row.push((self.whole, Matrix3::identity()));
        }

        // The middle of a whole epoch is no foot of a station.
        if let (Some((first, _)), Target::Stone { normal }) = (self.stretch, sight.target)
            && !block.is_alone
        {
            let arm = sight.place - block.middle;
            let in_face = arm - normal * normal.dot(&arm);
            let of_epoch = |epoch| {
                if block.epoch == epoch {
                    in_face
                } else {
                    Vector3::zeros()
                }
            };
            row.push((first, Matrix3::from_columns(&[in_face, of_epoch(0), of_epoch(1)])));
        }

        let Some(plane) = sight.plane() else { return row };
        if let Some(first) = self.planes.get(&(plane, self.of_source[sight.source])) {
            row.push((*first, Matrix3::identity()));
        }
        row
    }

    /// Rows of an observation's differences, dense over the unknowns that it touches: indices and matrix.
    pub fn design(&self, observation: &Observation) -> (Vec<usize>, DMatrix<f64>) {
        let rows: Vec<Row> = observation.sights.iter().map(|s| self.row(s)).collect();
        let mut firsts: Vec<usize> = rows.iter().flatten().map(|r| r.0).collect();
        firsts.sort_unstable();
        firsts.dedup();
        let m = observation.directions.len();
        let mut matrix = DMatrix::zeros(m * (rows.len() - 1), 3 * firsts.len());
        for (k, row) in rows.iter().enumerate().skip(1) {
            for (part, sign) in [(row, 1.0), (&rows[0], -1.0)] {
                for (first, coefficients) in part {
                    let Ok(at) = firsts.binary_search(first) else {
                        continue;
                    };
                    for (d, direction) in observation.directions.iter().enumerate() {
                        let mut target = matrix.view_mut(((k - 1) * m + d, 3 * at), (1, 3));
                        target += direction.transpose() * coefficients * sign;
                    }
                }
            }
        }
        let indices = firsts.iter().flat_map(|f| [*f, f + 1, f + 2]).collect();
        (indices, matrix)
    }

    /// How an observation's differences depend on a motion of its place between the epochs.
    fn motion_design(&self, observation: &Observation) -> DMatrix<f64> {
        let m = observation.directions.len();
        let is_later = |k: usize| self.epochs[observation.sights[k].source] as f64;
        DMatrix::from_fn(observation.len(), 3, |row, axis| {
            let sign = is_later(1 + row / m) - is_later(0);
            sign * observation.directions[row % m][axis]
        })
    }

    /// Information of the prior, and the logarithm of its determinant.
    pub fn prior(&self, prior: &Prior) -> (DMatrix<f64>, f64) {
        let mut matrix = DMatrix::zeros(self.count(), self.count());
        let mut log_det = 0.0;
        let mut diagonal = |matrix: &mut DMatrix<f64>, first: usize, sds: [f64; 3]| {
            for (k, sd) in (first..).zip(sds) {
                matrix[(k, k)] = 1.0 / (sd * sd);
                log_det -= 2.0 * sd.ln();
            }
        };

        for block in &self.blocks {
            diagonal(&mut matrix, block.first, [prior.translation_m; 3]);
            diagonal(&mut matrix, block.first + 3, [prior.rotation_m; 3]);
        }

        if let Some((first, sd)) = self.stretch {
            diagonal(&mut matrix, first, [sd.shared, sd.of_epoch, sd.of_epoch]);
        }
        for first in self.planes.values() {
            diagonal(&mut matrix, *first, [prior.plane_m.max(LEAST_M); 3]);
        }
        let of_whole = prior.whole.symmetric_eigen();
        let information = of_whole.eigenvalues.map(|v| v.max(LEAST_M * LEAST_M).recip());
        log_det += information.map(f64::ln).sum();
        matrix.fixed_view_mut::<3, 3>(self.whole, self.whole).copy_from(
            &(of_whole.eigenvectors
                * Matrix3::from_diagonal(&information)
                * of_whole.eigenvectors.transpose()),
        );

        for block in &self.blocks {
            let (inverse, knots_log_det) = knot_information(&block.knots, prior.drift(block));
            log_det += 3.0 * knots_log_det;
            for ((r, c), value) in (0..block.knots.len())
                .flat_map(|r| (0..block.knots.len()).map(move |c| (r, c)))
                .map(|at| (at, inverse[at]))
            {
                for axis in 0..3 {
                    let at = block.first + 6 + axis;
                    matrix[(at + 3 * r, at + 3 * c)] = value;
                }
            }
        }

        (matrix, log_det)
    }
}

impl Block {
    fn new(first: usize, sights: &[&Sight], source: &Source, is_alone: bool) -> Self {
        let count = sights.len().max(1) as f64;
        let middle = Point3::from(sights.iter().map(|s| s.place.coords).sum::<Vector3<f64>>() / count);
        let squares: f64 = sights.iter().map(|s| (s.place - middle).norm_squared()).sum();
        let mut block = Self {
            first,
            epoch: source.epoch,
            is_alone,
            middle,
            radius_m: (squares / count).sqrt().max(0.1),
            along: (!source.has_times).then(|| principal_axis(sights, &middle)),
            knots: Vec::new(),
        };
        let mut order: Vec<f64> = sights.iter().map(|s| block.order(s)).collect();
        order.sort_by(f64::total_cmp);
        let (low, high) = (order.first().copied(), order.last().copied());
        let (low, high) = (low.unwrap_or(0.0), high.unwrap_or(1.0));
        let knots = match &block.along {
            Some(_) if is_alone => ((high - low) / MERGED_KNOT_M).ceil() as usize + 1,
            _ => (sights.len() / SIGHTS_PER_KNOT).min(KNOTS[1]),
        };
        let knots = knots.clamp(KNOTS[0], MOST_KNOTS);
        let step = ((high - low) / (knots - 1) as f64).max(1e-6);
        block.knots = (0..knots).map(|k| low + step * k as f64).collect();
        block
    }

    /// From the first knot to the last, in seconds or metres.
    fn duration(&self) -> f64 {
        self.knots[self.knots.len() - 1] - self.knots[0]
    }

    /// What orders a source's errors: its time, or the place along it.
    fn order(&self, sight: &Sight) -> f64 {
        match &self.along {
            Some(axis) => (sight.place - self.middle).dot(axis),
            None => sight.time_s,
        }
    }

    /// The two knots around `t` with their weights.
    fn between(&self, t: f64) -> [(usize, f64); 2] {
        let last = self.knots.len() - 1;
        let step = self.knots[1] - self.knots[0];
        let at = ((t - self.knots[0]) / step).clamp(0.0, last as f64);
        let k = (at.floor() as usize).min(last - 1);
        let share = at - k as f64;
        [(k, 1.0 - share), (k + 1, share)]
    }
}

/// Information of a drift at its knots and the logarithm of its determinant, for one axis; `drift`: standard
/// deviation and correlation length.
fn knot_information(knots: &[f64], drift: (f64, f64)) -> (DMatrix<f64>, f64) {
    let n = knots.len();
    let (sd_m, length) = drift;
    let variance = sd_m * sd_m;
    let covariance = DMatrix::from_fn(n, n, |r, c| {
        let scaled = 3f64.sqrt() * (knots[r] - knots[c]).abs() / length;
        let nugget = if r == c { KNOT_NUGGET } else { 0.0 };
        variance * ((1.0 + scaled) * (-scaled).exp() + nugget)
    });
    match Cholesky::<f64, Dyn>::new(covariance) {
        Some(factor) => {
            let log_det = -2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
            (factor.inverse(), log_det)
        }
        // Numbers this far apart: independent knots.
        None => (DMatrix::identity(n, n) / variance, -(n as f64) * variance.ln()),
    }
}

/// Direction in which places spread most.
fn principal_axis(sights: &[&Sight], middle: &Point3<f64>) -> Vector3<f64> {
    let mut spread = Matrix3::zeros();
    for sight in sights {
        let d = sight.place - middle;
        spread += d * d.transpose();
    }
    let eigen = spread.symmetric_eigen();
    eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned()
}

/// Normal equations of all observations about given variances.
pub(super) struct Solution {
    pub mean: DVector<f64>,
    /// Covariance of the unknowns.
    pub covariance: DMatrix<f64>,
}

impl Solution {
    /// A linear function of the unknowns: mean and covariance.
    pub fn function(&self, row: &Row) -> (Vector3<f64>, Matrix3<f64>) {
        let mut mean = Vector3::zeros();
        let mut covariance = Matrix3::zeros();
        for (a, of_a) in row {
            mean += of_a * self.mean.fixed_rows::<3>(*a);
            for (b, of_b) in row {
                covariance += of_a * self.covariance.fixed_view::<3, 3>(*a, *b) * of_b.transpose();
            }
        }
        (mean, 0.5 * (covariance + covariance.transpose()))
    }
}

/// Normal equations, and the deviance of what does not depend on the unknowns.
struct Normal {
    information: DMatrix<f64>,
    vector: DVector<f64>,
    deviance: f64,
}

impl Normal {
    /// Adds those of a problem without its prior, times `sign`, each unknown at its `place`.
    fn add(
        &mut self,
        problem: &Problem,
        components: &ObserverComponents,
        sign: f64,
        place: impl Fn(usize) -> usize,
    ) -> Option<()> {
        for (observation, indices, design) in &problem.designs {
            let covariance = observation.covariance(components.noise_scale, components.nugget_m);
            let factor = Cholesky::new(covariance)?;
            let scaled = factor.solve(design);
            let of_values = factor.solve(&observation.values);
            self.deviance +=
                2.0 * factor.l_dirty().diagonal().map(f64::ln).sum() + observation.values.dot(&of_values);
            let block = design.transpose() * scaled;
            let part = design.transpose() * of_values;
            let places: Vec<usize> = indices.iter().map(|&unknown| place(unknown)).collect();
            for (r, &row) in places.iter().enumerate() {
                self.vector[row] += sign * part[r];
                for (c, &column) in places.iter().enumerate() {
                    self.information[(row, column)] += sign * block[(r, c)];
                }
            }
        }
        Some(())
    }
}

/// Normal equations of some observations, without the prior, over the unknowns that they touch.
pub(super) struct Part {
    /// Number of differences.
    pub differences: usize,
    /// The unknowns, ascending.
    pub unknowns: Vec<usize>,
    pub information: DMatrix<f64>,
    pub vector: DVector<f64>,
}

/// Observations with the unknowns that they touch.
pub(super) struct Problem<'a> {
    pub unknowns: &'a Unknowns,
    designs: Vec<(&'a Observation, Vec<usize>, DMatrix<f64>)>,
}

impl<'a> Problem<'a> {
    pub fn new(unknowns: &'a Unknowns, observations: &[&'a Observation]) -> Self {
        let designs = observations.iter().map(|o| {
            let (indices, matrix) = unknowns.design(o);
            (*o, indices, matrix)
        });
        Self {
            unknowns,
            designs: designs.collect(),
        }
    }

    /// Normal equations: information and vector with the prior's, and the deviance of what does not depend on
    /// the unknowns.
    fn normal(
        &self,
        prior: &Prior,
        components: &ObserverComponents,
    ) -> Option<(DenseFactor, DVector<f64>, f64)> {
        let (information, prior_log_det) = self.unknowns.prior(prior);
        let mut sum = Normal {
            information,
            vector: DVector::zeros(self.unknowns.count()),
            deviance: -prior_log_det,
        };
        sum.add(self, components, 1.0, |unknown| unknown)?;
        Some((DenseFactor::of(&sum.information)?, sum.vector, sum.deviance))
    }

    /// What the observations add to the normal equations beyond those of `rest`, which touch no other unknowns.
    pub fn beyond(&self, rest: &Self, components: &ObserverComponents) -> Option<Part> {
        let mut unknowns: Vec<usize> = self.designs.iter().flat_map(|d| d.1.iter().copied()).collect();
        unknowns.sort_unstable();
        unknowns.dedup();
        let count = unknowns.len();
        let mut sum = Normal {
            information: DMatrix::zeros(count, count),
            vector: DVector::zeros(count),
            deviance: 0.0,
        };
        for (problem, sign) in [(self, 1.0), (rest, -1.0)] {
            let place = |unknown| unknowns.partition_point(|u| *u < unknown);
            sum.add(problem, components, sign, place)?;
        }
        let differences = |p: &Self| p.designs.iter().map(|d| d.0.len()).sum::<usize>();
        Some(Part {
            differences: differences(self) - differences(rest),
            unknowns,
            information: sum.information,
            vector: sum.vector,
        })
    }

    /// Minus twice the log marginal likelihood, up to a constant; `None` where the numbers fail.
    pub fn deviance(&self, prior: &Prior, components: &ObserverComponents) -> Option<f64> {
        let (factor, vector, deviance) = self.normal(prior, components)?;
        Some(deviance + factor.log_det() - vector.dot(&factor.solve(&vector)))
    }

    /// The unknowns without their covariance; `None` where the numbers fail.
    pub fn mean(&self, prior: &Prior, components: &ObserverComponents) -> Option<DVector<f64>> {
        let (factor, vector, _) = self.normal(prior, components)?;
        Some(factor.solve(&vector))
    }

    /// The unknowns; `None` where the numbers fail.
    pub fn solve(&self, prior: &Prior, components: &ObserverComponents) -> Option<Solution> {
        let (factor, vector, _) = self.normal(prior, components)?;
        Some(Solution {
            mean: factor.solve(&vector),
            covariance: factor.inverse(),
        })
    }

    /// Information and vector of a motion, between the epochs, of the places of some observations, all else
    /// as in `solution` (data snooping; Baarda 1968).
    pub fn motion_of(
        &self,
        solution: &Solution,
        components: &ObserverComponents,
        is_doubted: impl Fn(&Observation) -> bool,
    ) -> (Matrix3<f64>, Vector3<f64>) {
        let (mut information, mut vector) = (Matrix3::zeros(), Vector3::zeros());
        let mut cross = DMatrix::zeros(self.unknowns.count(), 3);
        for (observation, indices, design) in self.designs.iter().filter(|d| is_doubted(d.0)) {
            let covariance = observation.covariance(components.noise_scale, components.nugget_m);
            let Some(factor) = Cholesky::new(covariance) else {
                continue;
            };
            let motion = self.unknowns.motion_design(observation);
            let part = DVector::from_iterator(indices.len(), indices.iter().map(|&i| solution.mean[i]));
            let scaled = factor.solve(&motion);
            information += motion.transpose() * &scaled;
            vector += scaled.transpose() * (&observation.values - design * part);
            let block = design.transpose() * scaled;
            for (r, &row) in indices.iter().enumerate() {
                let mut target = cross.row_mut(row);
                target += block.row(r);
            }
        }
        let explained = cross.transpose() * &solution.covariance * &cross;
        (information - explained.fixed_view::<3, 3>(0, 0), vector)
    }

    /// Weight that each observation keeps: stones and cells that do not fit the rest are disturbed.
    pub fn weights(&self, mean: &DVector<f64>, components: &ObserverComponents) -> Vec<f64> {
        let weight = |(misfit, (o, _, _)): (f64, &(&Observation, _, _))| {
            let limit = if o.plane().is_some() { CELL_MISFIT } else { MISFIT };
            if misfit > limit { limit / misfit } else { 1.0 }
        };
        let misfits = self.misfits(mean, components);
        misfits.into_iter().zip(&self.designs).map(weight).collect()
    }

    /// The same where the variances are not known yet: misfits are compared with their median.
    pub fn gross_weights(&self, mean: &DVector<f64>, components: &ObserverComponents) -> Vec<f64> {
        let misfits = self.misfits(mean, components);
        let usual = upper_median(&mut misfits.clone()).unwrap_or(1.0).max(1.0);
        let weight = |misfit: f64| (MISFIT * usual / misfit).min(1.0);
        misfits.into_iter().map(weight).collect()
    }

    /// Squared standardised residual of each observation per difference, at `mean`.
    fn misfits(&self, mean: &DVector<f64>, components: &ObserverComponents) -> Vec<f64> {
        let misfit = |(observation, indices, design): &(&Observation, Vec<usize>, DMatrix<f64>)| {
            let part = DVector::from_iterator(indices.len(), indices.iter().map(|&i| mean[i]));
            let residual = &observation.values - design * part;
            let covariance =
                observation.covariance(components.noise_scale, components.nugget_m) * observation.weight;
            Cholesky::new(covariance).map_or(0.0, |f| residual.dot(&f.solve(&residual)))
                / observation.len().max(1) as f64
        };
        self.designs.iter().map(misfit).collect()
    }
}
