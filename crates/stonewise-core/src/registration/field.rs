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
use super::sparse::{BlockMatrix, BlockPattern, SelectedInverse};
use nalgebra::{Matrix3, Matrix6, Vector6};
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

/// Solves for the field. `None` only where memory or the numbers fail.
pub(super) fn solve(
    graph: &Graph,
    pattern: &BlockPattern,
    terms: &[StoneTerm],
    components: &VarianceComponents,
    loose: &LoosePrior,
    beliefs: &Beliefs,
) -> Option<Field> {
    let mut matrix = prior(graph, pattern, components, beliefs);
    let mut rhs = vec![Motion9::zeros(); terms.len()];
    let reduced = reduce(terms, components, loose, beliefs);
    for (i, (m, v, _)) in reduced.iter().enumerate() {
        let a = motion_of_field(&graph.nodes[i].face_from_world);
        matrix.diagonal[i] += a.transpose() * m * a;
        rhs[i] = a.transpose() * v;
    }
    let factor = pattern.factor(&matrix)?;
    let state = factor.solve(&rhs);
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
        state,
        from_others,
        inverse,
    })
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
                let blocks = tie_blocks(edge, &part);
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
    for (weight, s) in beliefs.tie.iter_mut().zip(&strain) {
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
                probes.push(l);
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
    let mut matrix = prior(graph, pattern, components, beliefs);
    let prior_log_det = pattern.factor(&matrix)?.log_det();
    let mut rhs = vec![Motion9::zeros(); terms.len()];
    let mut evidence = 0.0;
    for (i, (m, v, c)) in reduce(terms, components, loose, beliefs).iter().enumerate() {
        let a = motion_of_field(&graph.nodes[i].face_from_world);
        matrix.diagonal[i] += a.transpose() * m * a;
        rhs[i] = a.transpose() * v;
        evidence += c;
    }
    let factor = pattern.factor(&matrix)?;
    let state = factor.solve(&rhs);
    let quadratic: f64 = state.iter().zip(&rhs).map(|(s, r)| s.dot(r)).sum();
    Some(factor.log_det() - prior_log_det - quadratic - 2.0 * evidence)
}

/// Eliminates each stone's own motion: information and vector about the field, and log evidence.
fn reduce(
    terms: &[StoneTerm],
    components: &VarianceComponents,
    loose: &LoosePrior,
    beliefs: &Beliefs,
) -> Vec<(Matrix9, Motion9, f64)> {
    let classes = [components.own_variances(), loose_variances(components, loose)];
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
        let [ll, hl, hh] = tie_blocks(edge, components);
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

/// Information of one whole tie: low-low, high-low, high-high.
fn tie_blocks(edge: &Edge, components: &VarianceComponents) -> [Matrix9; 3] {
    let length = edge.length_m;
    let level = in_and_out(
        &edge.face_from_world,
        components.drift.map(|q| q * q * length.powi(3) / 12.0),
    );
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
    face_from_world.transpose() * Matrix3::from_diagonal(&nalgebra::Vector3::new(i, i, o)) * face_from_world
}
