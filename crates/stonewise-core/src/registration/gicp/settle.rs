//! Iteration to the motion at which the weighted residuals of all pairs balance.

use super::block::GicpBlock;
use super::params::GicpParams;
use super::window::{Information, Motion, Pair, WindowPoint, for_each_pair};
use crate::stone::MotionFailure;
use nalgebra::{Cholesky, Const, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};

/// Strides of the subsets of points that are aligned first: they cover most of the way at a fraction of the
/// cost.
const WARM_STRIDES: [usize; 2] = [16, 4];
/// Fewest points of such a subset.
const WARM_POINTS: usize = 1000;
/// A subset stops at steps of this many tolerances: its motion differs by more than that from the motion of
/// all points anyway.
const WARM_TOLERANCES: f64 = 20.0;
/// Factor by which a damped step grows back in each iteration that does not turn back: slow, as partners on
/// the edge of a jump would set off the next swing.
const RECOVERY: f64 = 1.02;
/// Each step is about a third shorter than the one before, so that the sum of all later steps stays below
/// this many times the current step.
const REACH_STEPS: f64 = 4.0;
/// The remaining steps are short if they sum to less than this share of the point spacing: few points can
/// then change partners.
const SHORT_WAY: f64 = 0.05;

/// A window to be moved onto the second epoch.
pub(super) struct Alignment<'a> {
    window: &'a mut [WindowPoint],
    second: &'a GicpBlock,
    /// Centroid of the stone in the frame of the second block.
    centre: Point3<f64>,
    params: &'a GicpParams,
    /// Longest arm of the window, metres.
    radius_m: f64,
}

/// A subset of the points, and the step at which its iteration stops.
struct Share {
    /// One point in this many takes part.
    stride: usize,
    /// Steps below this many times the tolerances end the iteration.
    tolerances: f64,
}

/// Normal equations of all pairs under a motion: their information on a step, and the right-hand side.
struct Equations {
    motion: Motion,
    information: Matrix6<f64>,
    pull: Vector6<f64>,
}

/// A point whose partner may change during the short steps.
struct Wavering {
    /// In the window.
    index: usize,
    /// Rotated arm and position before the short steps.
    arm: Vector3<f64>,
    place: Point3<f64>,
    /// Partner before the short steps.
    partner: Option<usize>,
}

impl<'a> Alignment<'a> {
    /// `centre`: centroid of the stone in the frame of the second block.
    pub(super) fn new(
        window: &'a mut [WindowPoint],
        second: &'a GicpBlock,
        centre: Point3<f64>,
        params: &'a GicpParams,
    ) -> Self {
        let radius_m = window.iter().map(|p| p.arm.norm()).fold(0.0, f64::max);
        Self {
            window,
            second,
            centre,
            params,
            radius_m,
        }
    }

    /// Moves the window until its steps are within the tolerances. `start`: its first shift.
    ///
    /// Subsets of the points cover most of the way. If a subset does not converge, the next one starts from
    /// the same motion as it did. If the iteration with all points does not converge, it is repeated from
    /// `start`.
    pub(super) fn iterate(&mut self, start: Vector3<f64>) -> Result<Motion, MotionFailure> {
        let first = Motion {
            shift: start,
            turn: UnitQuaternion::identity(),
        };
        let mut motion = first;
        let shares = WARM_STRIDES.into_iter().map(|stride| Share {
            stride,
            tolerances: WARM_TOLERANCES,
        });
        for share in shares {
            if self.window.len() / share.stride >= WARM_POINTS {
                motion = self.settle(motion, &share).unwrap_or(motion);
            }
        }
        let all = Share {
            stride: 1,
            tolerances: 1.0,
        };
        self.settle(motion, &all).or_else(|_| self.settle(first, &all))
    }

    fn settle(&mut self, mut motion: Motion, share: &Share) -> Result<Motion, MotionFailure> {
        let mut steps = Steps::new(self.params.max_iterations);
        while steps.left > 0 {
            let equations = self.equations(motion, share)?;
            let factor = equations.information.cholesky();
            let factor = factor.ok_or(MotionFailure::NotConverged)?;
            let step = steps.next(&factor, &equations.pull);
            motion = equations.motion.after(&step);
            if self.is_end(&step, share) {
                return Ok(motion);
            }
            if REACH_STEPS * self.way(&step) < SHORT_WAY * self.second.spacing_m {
                let way = self.short_way(&equations, &factor, step, share, &mut steps);
                motion = equations.motion.after(&way);
            }
        }
        Err(MotionFailure::NotConverged)
    }

    /// Continues from a first step without visiting all points, as long as the equations remain valid.
    ///
    /// The right-hand side of a pair that stays is linear in the step, so that only points whose partner
    /// changes are computed again. Weights are held; the next equations of all points correct them.
    fn short_way(
        &mut self,
        equations: &Equations,
        factor: &Cholesky<f64, Const<6>>,
        first: Vector6<f64>,
        share: &Share,
        steps: &mut Steps,
    ) -> Vector6<f64> {
        let reach = REACH_STEPS * self.way(&first);
        let wavering = self.wavering(&equations.motion, share, reach);
        let mut way = first;
        while steps.left > 0 && self.way(&way) < reach {
            let mut pull = equations.pull - equations.information * way;
            for point in &wavering {
                pull += self.change(point, &equations.motion, &way);
            }
            let step = steps.next(factor, &pull);
            way += step;
            if self.is_end(&step, share) {
                break;
            }
        }
        way
    }

    fn equations(&mut self, motion: Motion, share: &Share) -> Result<Equations, MotionFailure> {
        let params = self.params;
        let points = self.window.len().div_ceil(share.stride);
        let needed = (params.min_overlap * points as f64).max(params.min_points as f64);
        let (mut information, mut pull) = (Information::default(), Vector6::zeros());
        let chosen = self.window.iter_mut().step_by(share.stride);
        let max_m = params.max_distance_m;
        let count = for_each_pair(chosen, self.second, &self.centre, &motion, max_m, |pair| {
            let weight = pair.weight(params.plane_epsilon);
            information.add(&pair.arm, &weight);
            pull += pair.lever(&(weight * pair.residual));
        });
        if (count as f64) < needed {
            return Err(MotionFailure::Disagreement);
        }
        Ok(Equations {
            motion,
            information: information.matrix(),
            pull,
        })
    }

    /// Points that may get another partner within `reach_m` of where they are under a motion.
    fn wavering(&mut self, motion: &Motion, share: &Share, reach_m: f64) -> Vec<Wavering> {
        let (second, max_m) = (self.second, self.params.max_distance_m);
        let (rotation, place) = (motion.turn.to_rotation_matrix(), self.centre + motion.shift);
        let chosen = self.window.iter_mut().enumerate().step_by(share.stride);
        let wavering = chosen.filter_map(|(index, point)| {
            let arm = rotation * point.arm;
            let place = place + arm;
            let partner = point.partner.find(second, &place, max_m);
            (!point.partner.stays(partner, &place, reach_m, max_m)).then(|| Wavering {
                index,
                arm,
                place,
                partner: partner.map(|p| p.0),
            })
        });
        wavering.collect()
    }

    /// Change of a point's right-hand side where these steps give it another partner.
    fn change(&mut self, point: &Wavering, start: &Motion, way: &Vector6<f64>) -> Vector6<f64> {
        let moved = way.fixed_rows::<3>(0) + way.fixed_rows::<3>(3).cross(&point.arm);
        let place = point.place + moved;
        let own = &mut self.window[point.index];
        let found = own.partner.find(self.second, &place, self.params.max_distance_m);
        let partner = found.map(|p| p.0);
        if partner == point.partner {
            return Vector6::zeros();
        }
        let pull = |partner: usize| {
            let pair = Pair {
                arm: point.arm,
                normal: start.turn * own.normal,
                normal_second: self.second.normal(partner),
                residual: self.second.points[partner] - place,
            };
            pair.lever(&(pair.weight(self.params.plane_epsilon) * pair.residual))
        };
        partner.map_or(Vector6::zeros(), pull) - point.partner.map_or(Vector6::zeros(), pull)
    }

    /// How far a step moves a point of the window at most.
    fn way(&self, step: &Vector6<f64>) -> f64 {
        step.fixed_rows::<3>(0).norm() + self.radius_m * step.fixed_rows::<3>(3).norm()
    }

    fn is_end(&self, step: &Vector6<f64>, share: &Share) -> bool {
        let within =
            |from: usize, tolerance: f64| step.fixed_rows::<3>(from).norm() < share.tolerances * tolerance;
        within(0, self.params.tolerance_m) && within(3, self.params.tolerance_rad)
    }
}

/// Damped steps, and how many are left.
struct Steps {
    left: usize,
    damping: f64,
    last: Vector6<f64>,
}

impl Steps {
    fn new(left: usize) -> Self {
        Self {
            left,
            damping: 1.0,
            last: Vector6::zeros(),
        }
    }

    /// Partners change in jumps, so the balance may jump across zero without ever being zero. Steps that turn
    /// back are halved: they close in on the place of the jump.
    fn next(&mut self, factor: &Cholesky<f64, Const<6>>, pull: &Vector6<f64>) -> Vector6<f64> {
        self.damping = if pull.dot(&self.last) < 0.0 {
            0.5 * self.damping
        } else {
            f64::min(RECOVERY * self.damping, 1.0)
        };
        self.left -= 1;
        self.last = factor.solve(pull) * self.damping;
        self.last
    }
}
