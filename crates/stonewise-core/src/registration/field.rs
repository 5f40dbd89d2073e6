//! The joint adjustment: a smooth motion field over the wall plus each stone's own motion.
//!
//! Field unknowns of a stone: displacement d (world) and its derivatives along the face, g_a and g_u, nine in
//! all. Neighbours are tied by an integrated random walk: d changes as the mean gradient says, the gradient
//! changes slowly; rigid motion, tilt and even strain cost nothing beside `strain`. A stone's motion is the
//! field's displacement and rotation at its centroid plus a motion of its own, small for nearly all stones and
//! large for loose ones (a mixture).

use super::equations::{Matrix9, Motion9};
use super::graph::{Edge, Graph};
use super::hyper::{BOUNDS, COUNT, VarianceComponents};
use super::sparse::{BlockFactor, BlockMatrix, BlockPattern, SelectedInverse};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use rayon::prelude::*;

/// A stone's normal equations `information * x = vector`, in its frame.
#[derive(Clone, Debug)]
pub(super) struct StoneTerm {
    pub information: Matrix9,
    pub vector: Motion9,
    /// Log likelihood of the points at motion zero, by the same quadratic.
    pub constant: f64,
}

impl StoneTerm {
    /// Of a stone without points.
    pub fn nothing() -> Self {
        Self {
            information: Matrix9::zeros(),
            vector: Motion9::zeros(),
            constant: 0.0,
        }
    }
}

/// Beliefs that make the adjustment robust.
#[derive(Clone, Debug)]
pub(super) struct Beliefs {
    /// Probability that a stone moves with the field, per stone.
    pub tight: Vec<f64>,
    /// Weight of the tie, per edge: 1 whole, towards 0 broken.
    pub tie: Vec<f64>,
    /// Per edge: a break of the wall lies between. The motion may jump there, its gradient goes on.
    pub parted: Vec<bool>,
}

/// The mixture of loose stones.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoosePrior {
    pub share: f64,
    pub move_m: f64,
    pub turn_rad: f64,
}

/// What the field says of a stone: with its own points, and from all others alone.
#[derive(Clone, Debug)]
pub(super) struct Prediction {
    pub mean: Vector6<f64>,
    pub covariance: Matrix6<f64>,
}

/// The adjusted field.
pub(super) struct Field {
    /// Field unknowns, per stone.
    pub state: Vec<Motion9>,
    /// Prediction of each stone's motion without its own points, in its frame.
    pub from_others: Vec<Prediction>,
    /// Covariance of the field's mean over all stones, world, m^2.
    pub mean_covariance: Matrix3<f64>,
    inverse: SelectedInverse,
}

/// A stone's posterior in its frame.
#[derive(Clone, Debug)]
pub(super) struct Posterior {
    pub mean: Motion9,
    pub covariance: Matrix9,
    /// Log probability of the stone's points.
    pub log_evidence: f64,
    /// Squared standardised difference between the stone's points and the prediction, and its degrees of freedom.
    pub misfit: (f64, usize),
    /// How many unknowns the stone's own points determine, 0 to 9.
    pub determined: f64,
}

/// Prior standard deviation of a displacement about the common motion, metres.
const LEVEL_M: f64 = 0.3;
/// No tie is stiffer than a micrometre.
const STIFFEST: f64 = 1e12;
/// Share of a direction's prior variance that the points must explain for it to enter the misfit.
const INFORMED: f64 = 0.1;

/// The six motion components of a stone in its frame from its nine field unknowns.
pub(super) fn motion_of_field(frame: &Matrix3<f64>) -> Matrix9 {
    let mut a = Matrix9::zeros();
    a.fixed_view_mut::<3, 3>(0, 0).copy_from(frame);
    for c in 0..3 {
        a[(3, 6 + c)] = frame[(2, c)];
        a[(4, 3 + c)] = -frame[(2, c)];
        a[(5, 3 + c)] = 0.5 * frame[(1, c)];
        a[(5, 6 + c)] = -0.5 * frame[(0, c)];
    }
    a
}

/// The normal equations of the field, factored.
struct Normal<'a> {
    factor: BlockFactor<'a>,
    state: Vec<Motion9>,
    /// Each stone's information and vector about the field's motion in its frame, its own motion eliminated.
    reduced: Vec<(Matrix9, Motion9, f64)>,
}

fn normal_equations<'a>(
    graph: &Graph,
    pattern: &'a BlockPattern,
    terms: &[StoneTerm],
    components: &VarianceComponents,
    classes: &[[f64; 9]; 2],
    beliefs: &Beliefs,
) -> Option<Normal<'a>> {
    let mut matrix = prior(graph, pattern, components, beliefs);
    let mut rhs = vec![Motion9::zeros(); terms.len()];
    let reduced = reduce(terms, classes, beliefs);
    for (i, (m, v, _)) in reduced.iter().enumerate() {
        let a = motion_of_field(&graph.nodes[i].face_from_world);
        matrix.diagonal[i] += a.transpose() * m * a;
        rhs[i] = a.transpose() * v;
    }
    let factor = pattern.factor(&matrix)?;
    let state = factor.solve(&rhs);
    Some(Normal {
        factor,
        state,
        reduced,
    })
}

/// Solves for the field. `None` only where memory or the numbers fail.
pub(super) fn solve(
    graph: &Graph,
    pattern: &BlockPattern,
    terms: &[StoneTerm],
    components: &VarianceComponents,
    loose: &LoosePrior,
    beliefs: &Beliefs,
) -> Option<Field> {
    let Normal {
        factor,
        state,
        reduced,
    } = normal_equations(
        graph,
        pattern,
        terms,
        components,
        &classes(components, loose),
        beliefs,
    )?;
    let inverse = factor.selected_inverse()?;
    let from_others = (0..terms.len())
        .into_par_iter()
        .map(|i| {
            let a = motion_of_field(&graph.nodes[i].face_from_world);
            let with = (a * inverse.diagonal[i] * a.transpose())
                .fixed_view::<6, 6>(0, 0)
                .into_owned();
            let mean = (a * state[i]).fixed_rows::<6>(0).into_owned();
            let m = reduced[i].0.fixed_view::<6, 6>(0, 0).into_owned();
            let v = reduced[i].1.fixed_rows::<6>(0).into_owned();
            without_own(&mean, &with, &m, &v)
        })
        .collect();
    Some(Field {
        mean_covariance: mean_covariance(&factor, terms.len()),
        state,
        from_others,
        inverse,
    })
}

/// Covariance of the mean displacement over all stones: w' A^-1 w with w = 1/n at every stone's displacement.
fn mean_covariance(factor: &BlockFactor, stones: usize) -> Matrix3<f64> {
    let share = 1.0 / stones.max(1) as f64;
    let columns = [0, 1, 2].map(|c| {
        let mut weight = Motion9::zeros();
        weight[c] = share;
        let solved = factor.solve(&vec![weight; stones]);
        solved
            .iter()
            .map(|x| x.fixed_rows::<3>(0) * share)
            .sum::<Vector3<f64>>()
    });
    let covariance = Matrix3::from_columns(&columns);
    0.5 * (covariance + covariance.transpose())
}

/// A jump of the motion between two sides of the wall, beyond what the ties between them allow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jump {
    /// Motion of the side that moved against the other, world, metres.
    pub jump: Vector3<f64>,
    /// Its square in units of its covariance: chi-square with three degrees of freedom where nothing jumped.
    pub excess: f64,
}

/// Estimates, for each way to part the stones into two sides, the common jump of the stones marked `true`.
///
/// The jump is three more unknowns of the adjustment: with P the matrix of the field and Q the jump's columns, its information is
/// R - Q' P^-1 Q, and P need not be factored again. Cost: three solves a way. `None` where the equations cannot be factored.
pub(super) fn test_jumps(
    graph: &Graph,
    pattern: &BlockPattern,
    terms: &[StoneTerm],
    components: &VarianceComponents,
    loose: &LoosePrior,
    beliefs: &Beliefs,
    sides: &[Vec<bool>],
) -> Option<Vec<Jump>> {
    let normal = normal_equations(
        graph,
        pattern,
        terms,
        components,
        &classes(components, loose),
        beliefs,
    )?;
    let of_stone: Vec<(Matrix9, Motion9)> = normal
        .reduced
        .iter()
        .zip(&graph.nodes)
        .map(|((m, v, _), node)| {
            let a = motion_of_field(&node.face_from_world);
            (a.transpose() * m * a, a.transpose() * v)
        })
        .collect();
    let test = |side: &Vec<bool>| {
        let moved = || (0..side.len()).filter(|&i| side[i]);
        let solved = [0, 1, 2].map(|c| {
            let column = |i: usize| of_stone[i].0.column(c) * f64::from(u8::from(side[i]));
            normal
                .factor
                .solve(&(0..side.len()).map(column).collect::<Vec<_>>())
        });
        let mut information = Matrix3::zeros();
        let mut vector = Vector3::zeros();
        for i in moved() {
            let (m, v) = &of_stone[i];
            information += m.fixed_view::<3, 3>(0, 0);
            vector += (v - m * normal.state[i]).fixed_rows::<3>(0);
            for (c, column) in solved.iter().enumerate() {
                let known = m.fixed_rows::<3>(0) * column[i];
                let mut target = information.column_mut(c);
                target -= known;
            }
        }
        let information = 0.5 * (information + information.transpose());
        match information.cholesky() {
            Some(factor) => {
                let jump = factor.solve(&vector);
                Jump {
                    jump,
                    excess: jump.dot(&vector),
                }
            }
            None => Jump {
                jump: Vector3::zeros(),
                excess: 0.0,
            },
        }
    };
    Some(sides.par_iter().map(test).collect())
}

/// Takes a stone's own information back out of the field at the stone.
fn without_own(mean: &Vector6<f64>, with: &Matrix6<f64>, m: &Matrix6<f64>, v: &Vector6<f64>) -> Prediction {
    // Q_l = Q (I - M Q)^-1, mu_l = (I - Q M)^-1 (mu - Q v): no inverse of Q, which may be nearly singular.
    let left = Matrix6::identity() - with * m;
    match left.try_inverse() {
        Some(inverse) => {
            let covariance = inverse * with;
            Prediction {
                mean: inverse * (mean - with * v),
                covariance: 0.5 * (covariance + covariance.transpose()),
            }
        }
        None => Prediction {
            mean: *mean,
            covariance: *with,
        },
    }
}

/// Posterior of a stone given the field from all others and its own points, for own variances `own`.
pub(super) fn posterior(term: &StoneTerm, prediction: &Prediction, own: &[f64; 9]) -> Posterior {
    let mut spread = Matrix9::zeros();
    spread
        .fixed_view_mut::<6, 6>(0, 0)
        .copy_from(&prediction.covariance);
    let mut mean = Motion9::zeros();
    mean.fixed_rows_mut::<6>(0).copy_from(&prediction.mean);
    for k in 0..9 {
        spread[(k, k)] += own[k] * (1.0 + 1e-9) + 1e-18;
    }
    let root = spread.cholesky().map_or_else(
        || Matrix9::from_diagonal(&spread.diagonal().map(|v| v.max(0.0).sqrt())),
        |c| c.l(),
    );
    let gain = root.transpose() * term.information * root;
    let surprise = root.transpose() * (term.vector - term.information * mean);
    let eigen = (0.5 * (gain + gain.transpose())).symmetric_eigen();
    let mut step = Motion9::zeros();
    let mut covariance = Matrix9::zeros();
    let at_mean = term.vector.dot(&mean) - 0.5 * mean.dot(&(term.information * mean));
    let (mut log_evidence, mut misfit, mut freedom) = (term.constant + at_mean, 0.0, 0);
    for k in 0..9 {
        let g = eigen.eigenvalues[k].max(0.0);
        let direction = eigen.eigenvectors.column(k).into_owned();
        let s = direction.dot(&surprise);
        step += direction * (s / (1.0 + g));
        covariance += direction * direction.transpose() / (1.0 + g);
        log_evidence += 0.5 * (s * s / (1.0 + g) - (1.0 + g).ln());
        if g > INFORMED {
            misfit += s * s / (g * (1.0 + g));
            freedom += 1;
        }
    }
    Posterior {
        mean: mean + root * step,
        covariance: root * covariance * root.transpose(),
        log_evidence,
        misfit: (misfit, freedom),
        determined: eigen
            .eigenvalues
            .iter()
            .map(|g| g.max(0.0) / (1.0 + g.max(0.0)))
            .sum(),
    }
}

/// Own variances of a loose stone.
pub(super) fn loose_variances(components: &VarianceComponents, loose: &LoosePrior) -> [f64; 9] {
    let mut own = components.own_variances();
    for k in 0..3 {
        own[k] += loose.move_m * loose.move_m;
        own[3 + k] += loose.turn_rad * loose.turn_rad;
    }
    own
}

/// Probability of each stone to move with the field, given all others.
///
/// A loose stone's likelihood is taken at its own optimum where that is followed. `shared`: variances of errors
/// that look like a stone's own motion.
pub(super) fn tight_probability(
    terms: &[StoneTerm],
    free: &[Option<StoneTerm>],
    field: &Field,
    components: &VarianceComponents,
    loose: &LoosePrior,
    shared: &[f64; 9],
) -> Vec<f64> {
    let add = |v: [f64; 9]| std::array::from_fn(|k| v[k] + shared[k]);
    let own: [f64; 9] = add(components.own_variances());
    let wide: [f64; 9] = add(loose_variances(components, loose));
    (0..terms.len())
        .into_par_iter()
        .map(|i| {
            let prediction = &field.from_others[i];
            let tight = posterior(&terms[i], prediction, &own).log_evidence + (1.0 - loose.share).ln();
            let free = free[i].as_ref().unwrap_or(&terms[i]);
            let loose = posterior(free, prediction, &wide).log_evidence + loose.share.ln();
            1.0 / (1.0 + (loose - tight).exp())
        })
        .collect()
}

/// Expected squared standardised strain of each tie as if it were whole: six components in the face, three out.
pub(super) fn tie_strain(graph: &Graph, field: &Field, components: &VarianceComponents) -> Vec<[f64; 2]> {
    const NO_TIE: f64 = 1e9;
    let [inside, outside] = components.drift;
    let parts =
        [[inside, NO_TIE], [NO_TIE, outside]].map(|drift| VarianceComponents { drift, ..*components });
    graph
        .edges
        .par_iter()
        .enumerate()
        .map(|(e, edge)| {
            parts.map(|part| {
                let blocks = tie_blocks(edge, &part, false);
                let (low, high) = (&field.state[edge.low], &field.state[edge.high]);
                let mean = (low.transpose() * blocks[0] * low + high.transpose() * blocks[2] * high)[0]
                    + 2.0 * (high.transpose() * blocks[1] * low)[0];
                let spread = (blocks[0] * field.inverse.diagonal[edge.low]).trace()
                    + (blocks[2] * field.inverse.diagonal[edge.high]).trace()
                    + 2.0 * (blocks[1].transpose() * field.inverse.edges[e]).trace();
                (mean + spread).max(0.0)
            })
        })
        .collect()
}

/// Weights of the ties and the drift that goes with them: one step of expectation maximisation for a
/// multivariate t law with `freedom` degrees of freedom (Liu, Rubin & Wu 1998, parameter-expanded).
pub(super) fn learn_ties(
    graph: &Graph,
    field: &Field,
    components: &mut VarianceComponents,
    beliefs: &mut Beliefs,
    freedom: f64,
) {
    let strain = tie_strain(graph, field, components);
    // Ties outnumber stones: each holds a share of the field's nine freedoms, six of them in the face.
    let share = graph.nodes.len() as f64 / strain.len().max(1) as f64;
    let mut sums = [0.0; 3];
    for ((weight, s), parted) in beliefs.tie.iter_mut().zip(&strain).zip(&beliefs.parted) {
        if *parted {
            *weight = 1.0;
            continue;
        }
        *weight = (freedom + 9.0 * share) / (freedom + s[0] + s[1]);
        sums[0] += *weight * s[0] / (6.0 * share);
        sums[1] += *weight * s[1] / (3.0 * share);
        sums[2] += *weight;
    }
    if sums[2] > 0.0 {
        for k in 0..2 {
            components.drift[k] =
                (components.drift[k] * (sums[k] / sums[2]).sqrt()).clamp(BOUNDS[k][0], BOUNDS[k][1]);
        }
    }
}

/// Variance components under which the stones' normal equations are most likely, field integrated out.
pub(super) fn estimate_components(
    graph: &Graph,
    pattern: &BlockPattern,
    terms: &[StoneTerm],
    start: &VarianceComponents,
    loose: &LoosePrior,
    beliefs: &Beliefs,
) -> VarianceComponents {
    let value = |log: &[f64; COUNT]| {
        deviance(
            graph,
            pattern,
            terms,
            &VarianceComponents::from_log(*log),
            loose,
            beliefs,
        )
        .map_or(f64::MAX / 1e6, |d| {
            d + VarianceComponents::from_log(*log).penalty()
        })
    };
    let clamp = |log: [f64; COUNT]| -> [f64; COUNT] {
        std::array::from_fn(|k| log[k].clamp(BOUNDS[k][0].ln(), BOUNDS[k][1].ln()))
    };
    let mut log = clamp(start.to_log());
    let width = 0.4;
    for _ in 0..6 {
        let mut probes = vec![log];
        for k in 0..COUNT {
            for sign in [-1.0, 1.0] {
                let mut l = log;
                l[k] += sign * width;
                probes.push(clamp(l));
            }
        }
        let values: Vec<f64> = probes.par_iter().map(value).collect();
        let here = values[0];
        let step: [f64; COUNT] = std::array::from_fn(|k| {
            let (below, above) = (values[1 + 2 * k], values[2 + 2 * k]);
            let curvature = below + above - 2.0 * here;
            let slope = 0.5 * (below - above);
            if curvature > 1e-3 {
                (width * slope / curvature).clamp(-1.5, 1.5)
            } else {
                1.5 * slope.clamp(-1.0, 1.0)
            }
        });
        let candidates: Vec<[f64; COUNT]> = [1.0, 0.5, 0.2, 0.05]
            .iter()
            .map(|scale| clamp(std::array::from_fn(|k| log[k] + scale * step[k])))
            .collect();
        let trial: Vec<f64> = candidates.par_iter().map(value).collect();
        let best = (0..trial.len())
            .min_by(|&a, &b| trial[a].total_cmp(&trial[b]))
            .unwrap_or(0);
        if trial[best] > here - 0.02 {
            break;
        }
        log = candidates[best];
    }
    VarianceComponents::from_log(log)
}

/// Minus twice the log marginal likelihood of the normal equations, up to a constant.
fn deviance(
    graph: &Graph,
    pattern: &BlockPattern,
    terms: &[StoneTerm],
    components: &VarianceComponents,
    loose: &LoosePrior,
    beliefs: &Beliefs,
) -> Option<f64> {
    let prior_log_det = pattern
        .factor(&prior(graph, pattern, components, beliefs))?
        .log_det();
    // The terms are those of the points alone: the error in the face is among what is estimated.
    let mut classes = classes(components, loose);
    for v in classes.iter_mut().flat_map(|c| &mut c[..2]) {
        *v += components.error_m * components.error_m;
    }
    let normal = normal_equations(graph, pattern, terms, components, &classes, beliefs)?;
    let (mut quadratic, mut evidence) = (0.0, 0.0);
    for ((state, (_, v, c)), node) in normal.state.iter().zip(&normal.reduced).zip(&graph.nodes) {
        quadratic += (motion_of_field(&node.face_from_world) * state).dot(v);
        evidence += c;
    }
    Some(normal.factor.log_det() - prior_log_det - quadratic - 2.0 * evidence)
}

/// Variances of what stones do beside the field: those that move with it, and loose ones.
fn classes(components: &VarianceComponents, loose: &LoosePrior) -> [[f64; 9]; 2] {
    [components.own_variances(), loose_variances(components, loose)]
}

/// Eliminates each stone's own motion: information and vector about the field, and log evidence.
fn reduce(terms: &[StoneTerm], classes: &[[f64; 9]; 2], beliefs: &Beliefs) -> Vec<(Matrix9, Motion9, f64)> {
    terms
        .iter()
        .zip(&beliefs.tight)
        .map(|(term, &p)| {
            let mut sum = (Matrix9::zeros(), Motion9::zeros(), 0.0);
            for (own, share) in classes.iter().zip([p, 1.0 - p]) {
                if share > 1e-6 {
                    let (m, v, c) = reduce_one(term, own);
                    sum.0 += m * share;
                    sum.1 += v * share;
                    sum.2 += c * share;
                }
            }
            sum
        })
        .collect()
}

fn reduce_one(term: &StoneTerm, own: &[f64; 9]) -> (Matrix9, Motion9, f64) {
    let root = Motion9::from_fn(|k, _| own[k].sqrt());
    let (h, b) = (&term.information, &term.vector);
    let scaled = Matrix9::from_fn(|r, c| root[r] * h[(r, c)] * root[c]) + Matrix9::identity();
    let Some(factor) = scaled.cholesky() else {
        return (Matrix9::zeros(), Motion9::zeros(), 0.0);
    };
    let rb = root.component_mul(b);
    let rh = Matrix9::from_fn(|r, c| root[r] * h[(r, c)]);
    let solved = factor.solve(&rb);
    let m = h - rh.transpose() * factor.solve(&rh);
    let log_det: f64 = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    (
        0.5 * (m + m.transpose()),
        b - rh.transpose() * solved,
        0.5 * (rb.dot(&solved) - log_det),
    )
}

/// Information of the prior on the field.
fn prior(
    graph: &Graph,
    pattern: &BlockPattern,
    components: &VarianceComponents,
    beliefs: &Beliefs,
) -> BlockMatrix {
    let mut matrix = pattern.zeros();
    for (e, edge) in graph.edges.iter().enumerate() {
        let [ll, hl, hh] = tie_blocks(edge, components, beliefs.parted[e]);
        let w = beliefs.tie[e];
        matrix.diagonal[edge.low] += ll * w;
        matrix.diagonal[edge.high] += hh * w;
        matrix.edges[e] += hl * w;
    }
    for (i, node) in graph.nodes.iter().enumerate() {
        let strain = in_and_out(&node.face_from_world, components.strain.map(|s| s * s));
        let d = &mut matrix.diagonal[i];
        for c in 0..3 {
            d[(c, c)] += 1.0 / (LEVEL_M * LEVEL_M);
        }
        for g in [3, 6] {
            let mut view = d.fixed_view_mut::<3, 3>(g, g);
            view += strain;
        }
    }
    matrix
}

/// Information of one tie: low-low, high-low, high-high; of a parted one only the gradients are tied.
fn tie_blocks(edge: &Edge, components: &VarianceComponents, parted: bool) -> [Matrix9; 3] {
    let length = edge.length_m;
    let level = match parted {
        true => Matrix3::zeros(),
        false => in_and_out(
            &edge.face_from_world,
            components.drift.map(|q| q * q * length.powi(3) / 12.0),
        ),
    };
    let slope = in_and_out(&edge.face_from_world, components.drift.map(|q| q * q * length));
    let half = edge.step.map(|s| -0.5 * s);
    let low = [-1.0, half[0], half[1]];
    let high = [1.0, half[0], half[1]];
    let outer = |p: &[f64; 3], q: &[f64; 3], own: f64| {
        let mut block = Matrix9::zeros();
        for (a, pa) in p.iter().enumerate() {
            for (b, qb) in q.iter().enumerate() {
                let mut part = level * (pa * qb);
                if a == b && a > 0 {
                    part += slope * own;
                }
                block.fixed_view_mut::<3, 3>(3 * a, 3 * b).copy_from(&part);
            }
        }
        block
    };
    [
        outer(&low, &low, 1.0),
        outer(&high, &low, -1.0),
        outer(&high, &high, 1.0),
    ]
}

/// World information of a vector with these variances in the face and out of it.
fn in_and_out(face_from_world: &Matrix3<f64>, variance: [f64; 2]) -> Matrix3<f64> {
    let [i, o] = variance.map(|v| (1.0 / v).min(STIFFEST));
    face_from_world.transpose() * Matrix3::from_diagonal(&Vector3::new(i, i, o)) * face_from_world
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::graph::Place;
    use nalgebra::{DMatrix, DVector, Point3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A jump and its excess, from the whole matrix with three more unknowns, densely.
    fn dense_jump(
        matrix: &BlockMatrix,
        graph: &Graph,
        of_stone: &[(Matrix9, Motion9)],
        side: &[bool],
    ) -> Jump {
        let n = graph.nodes.len();
        let mut whole = DMatrix::<f64>::zeros(9 * n + 3, 9 * n + 3);
        let mut rhs = DVector::<f64>::zeros(9 * n + 3);
        for (i, d) in matrix.diagonal.iter().enumerate() {
            whole.view_mut((9 * i, 9 * i), (9, 9)).copy_from(d);
        }
        for (e, edge) in graph.edges.iter().enumerate() {
            let block = &matrix.edges[e];
            whole
                .view_mut((9 * edge.high, 9 * edge.low), (9, 9))
                .copy_from(block);
            whole
                .view_mut((9 * edge.low, 9 * edge.high), (9, 9))
                .copy_from(&block.transpose());
        }
        for (i, (m, v)) in of_stone.iter().enumerate() {
            rhs.rows_mut(9 * i, 9).copy_from(v);
            if side[i] {
                let mut corner = whole.view_mut((9 * n, 9 * n), (3, 3));
                corner += m.fixed_view::<3, 3>(0, 0);
                whole
                    .view_mut((9 * i, 9 * n), (9, 3))
                    .copy_from(&m.fixed_columns::<3>(0));
                whole
                    .view_mut((9 * n, 9 * i), (3, 9))
                    .copy_from(&m.fixed_rows::<3>(0));
                let mut tail = rhs.rows_mut(9 * n, 3);
                tail += v.fixed_rows::<3>(0);
            }
        }
        let inverse = whole.try_inverse().unwrap();
        let solution = &inverse * rhs;
        let jump = Vector3::new(solution[9 * n], solution[9 * n + 1], solution[9 * n + 2]);
        let covariance: Matrix3<f64> = inverse.fixed_view::<3, 3>(9 * n, 9 * n).into_owned();
        Jump {
            jump,
            excess: jump.dot(&covariance.try_inverse().map_or(jump, |i| i * jump)),
        }
    }

    #[test]
    fn a_jump_is_that_of_an_adjustment_with_three_more_unknowns() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let places: Vec<Place> = (0..12)
            .map(|k| Place {
                centroid: Point3::new(
                    0.01 * f64::from(k % 3),
                    0.3 * f64::from(k % 4),
                    0.2 * f64::from(k / 4),
                ),
                normal: Vector3::new(1.0, 0.1, 0.2).normalize(),
                weight: 100.0,
            })
            .collect();
        let graph = Graph::new(&places, 2);
        let edges: Vec<_> = graph.edges.iter().map(|e| (e.low, e.high)).collect();
        let pattern = BlockPattern::new(places.len(), &edges).unwrap();
        let terms: Vec<StoneTerm> = places
            .iter()
            .map(|_| {
                let m = Matrix9::from_fn(|_, _| rng.random_range(-1.0..1.0));
                StoneTerm {
                    information: (m * m.transpose() + Matrix9::identity()) * 1e5,
                    vector: Motion9::from_fn(|_, _| rng.random_range(-1.0..1.0)) * 1e3,
                    constant: 0.0,
                }
            })
            .collect();
        let components = VarianceComponents::start();
        let loose = LoosePrior {
            share: 0.03,
            move_m: 0.015,
            turn_rad: 0.02,
        };
        let beliefs = Beliefs {
            tight: vec![0.9; places.len()],
            tie: vec![1.0; edges.len()],
            parted: vec![false; edges.len()],
        };
        let side: Vec<bool> = (0..places.len()).map(|k| k % 4 >= 2).collect();
        let found = test_jumps(
            &graph,
            &pattern,
            &terms,
            &components,
            &loose,
            &beliefs,
            std::slice::from_ref(&side),
        )
        .unwrap()[0];
        let mut matrix = prior(&graph, &pattern, &components, &beliefs);
        let of_stone: Vec<(Matrix9, Motion9)> = reduce(&terms, &classes(&components, &loose), &beliefs)
            .iter()
            .zip(&graph.nodes)
            .map(|((m, v, _), node)| {
                let a = motion_of_field(&node.face_from_world);
                (a.transpose() * m * a, a.transpose() * v)
            })
            .collect();
        for (d, (m, _)) in matrix.diagonal.iter_mut().zip(&of_stone) {
            *d += m;
        }
        let expected = dense_jump(&matrix, &graph, &of_stone, &side);
        assert!((found.jump - expected.jump).norm() < 1e-9 + 1e-6 * expected.jump.norm());
        assert!(
            (found.excess / expected.excess - 1.0).abs() < 1e-6,
            "{found:?} {expected:?}"
        );
    }
}
