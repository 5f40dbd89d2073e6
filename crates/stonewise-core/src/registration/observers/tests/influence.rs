//! Leaving out, against the same survey without what is left out, and against dense matrices.

use super::*;
use crate::registration::observers::assumptions::Model;
use crate::registration::observers::influence::{Influence, Member, influences};

/// Errors of three sources in each of two epochs, metres.
const THREE: [Vector3<f64>; 6] = [
    Vector3::new(0.001, 0.0, -0.001),
    Vector3::new(-0.001, 0.001, 0.0),
    Vector3::new(0.0005, -0.0015, 0.001),
    Vector3::new(0.004, -0.003, 0.002),
    Vector3::new(0.002, -0.002, 0.004),
    Vector3::new(0.003, -0.001, 0.003),
];

fn found(sources: &[Source], stones: &[SeenStone], stable: &[StablePoints]) -> EpochErrors {
    let pair = EpochPair {
        stable,
        ..EpochPair::new(sources, stones, 0.002)
    };
    epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap()
}

fn of(errors: &EpochErrors, member: Member) -> &Influence {
    errors.influences.iter().find(|i| i.of == member).unwrap()
}

/// Three stable areas, the second of which moved by `moved` with the later epoch.
fn areas(errors: &[Vector3<f64>], moved: Vector3<f64>) -> Vec<StablePoints> {
    let places = [
        Vector3::zeros(),
        Vector3::new(5.0, 0.0, 0.0),
        Vector3::new(0.0, 4.0, 0.0),
    ];
    let of_area = |(area, place): (usize, &Vector3<f64>)| {
        let own = |(s, error): (usize, &Vector3<f64>)| match area == 1 && s >= errors.len() / 2 {
            true => error + moved,
            false => *error,
        };
        let errors: Vec<Vector3<f64>> = errors.iter().enumerate().map(own).collect();
        stable_area(area, place, &errors, 0.002)
    };
    places.iter().enumerate().flat_map(of_area).collect()
}

#[test]
fn influence_of_an_area_is_the_change_without_it() {
    let (sources, stones) = (sources(2), wall(&ERRORS, 0.002, 1));
    let all_areas = areas(&ERRORS, Vector3::new(1e-4, -1e-4, 1e-4));
    let all = found(&sources, &stones, &all_areas);
    assert_eq!((all.datum, all.moved_areas.len()), (Datum::Stable, 0));
    for area in 0..3 {
        let rest: Vec<StablePoints> = all_areas.iter().filter(|p| p.area != area).cloned().collect();
        let without = found(&sources, &stones, &rest);
        let influence = of(&all, Member::Area(area));
        let shifts = influence.shifts.as_ref().unwrap();
        let mut largest: f64 = 0.0;
        for (shift, (all, without)) in shifts.iter().zip(all.at.iter().zip(&without.at)) {
            let off = shift.unwrap() - (all.mean - without.mean);
            let variances = (without.covariance - all.covariance).diagonal();
            // Shifts are rounded to the micrometre.
            let of_sd = |a: usize| (off[a].abs() - 1e-6) / variances[a].max(1e-14).sqrt();
            largest = (0..3).map(of_sd).fold(largest, f64::max);
        }
        assert!(largest < 0.05, "{area}: {largest} standard deviations");
        assert!(influence.redundancy > 100.0, "{}", influence.redundancy);
        let blunder = influence.smallest_blunder_m.unwrap();
        assert!((2e-4..3e-3).contains(&blunder), "{blunder}");
    }
}

#[test]
fn influence_of_a_source_is_the_change_without_it() {
    // So little noise that the points show the errors.
    let (all_sources, stones) = (sources(3), wall(&THREE, 0.0002, 1));
    for stable in [Vec::new(), areas(&THREE, Vector3::zeros())] {
        let all = found(&all_sources, &stones, &stable);
        let displacement = |kept: &[usize]| {
            let mean = |epoch: usize| {
                let own: Vec<_> = kept
                    .iter()
                    .filter(|s| *s / 3 == epoch)
                    .map(|s| THREE[*s])
                    .collect();
                own.iter().sum::<Vector3<f64>>() / own.len() as f64
            };
            mean(1) - mean(0)
        };
        for left_out in 0..6 {
            let kept: Vec<usize> = (0..6).filter(|s| *s != left_out).collect();
            let number = |source: usize| kept.binary_search(&source).ok();
            let rest: Vec<Source> = kept.iter().map(|s| all_sources[*s].clone()).collect();
            let mut seen = stones.clone();
            for stone in &mut seen {
                stone.sights.retain(|s| s.source != left_out);
                stone
                    .sights
                    .iter_mut()
                    .for_each(|s| s.source = number(s.source).unwrap());
            }
            let in_areas = stable.iter().filter_map(|p| {
                let source = number(p.source)?;
                Some(StablePoints { source, ..p.clone() })
            });
            let without = found(&rest, &seen, &in_areas.collect::<Vec<_>>());
            assert_eq!(all.datum, without.datum);
            let influence = of(&all, Member::Source(left_out));
            // The mean of two errors less that of three.
            let sd = all.components.unwrap().translation_m * (1.0 / 2.0 - 1.0 / 3.0_f64).sqrt();
            let change = displacement(&kept) - displacement(&[0, 1, 2, 3, 4, 5]);
            let shifts = influence.shifts.as_ref().unwrap();
            for (shift, (all, without)) in shifts.iter().zip(all.at.iter().zip(&without.at)) {
                let expected = change - without.mean + all.mean;
                let off = shift.unwrap() - expected;
                assert!(off.amax() < 0.05 * sd, "{left_out}: {off} of {sd}, {expected}");
            }
        }
    }
}

#[test]
fn an_influence_is_none_where_nothing_else_shows_the_datum() {
    let (two, stones) = (sources(2), wall(&ERRORS, 0.002, 1));
    // One source less leaves an epoch whose only source nothing checks.
    let of_sources = found(&two, &stones, &[]);
    assert_eq!(of_sources.datum, Datum::Sources);
    assert!(of_sources.influences.iter().all(|i| i.shifts.is_none()));
    let with_area = found(&two, &stones, &stable_points(&ERRORS, 0.002));
    assert!(
        of(&with_area, Member::Area(0)).shifts.is_some(),
        "the sources remain"
    );
    assert!(of(&with_area, Member::Source(2)).shifts.is_some());
    // Only the second source of the later epoch shows the last stone there.
    let mut stones = stones;
    stones[19].sights.retain(|s| s.source != 2);
    let with_area = found(&two, &stones, &stable_points(&ERRORS, 0.002));
    let shifts = of(&with_area, Member::Source(3)).shifts.as_ref().unwrap();
    assert!(shifts[19].is_none() && shifts[18].is_some());
}

#[test]
fn influences_are_those_of_dense_matrices() {
    let sources = sources(3);
    let weighted: Vec<Observation> = (0..2)
        .flat_map(|e| {
            observations(e, &THREE, 0.001, 3 + e as u64)
                .into_iter()
                .step_by(9)
        })
        .collect();
    let place = |k: usize| weighted[k].sights[0].place;
    let stones: Vec<SeenStone> = (0..5)
        .map(|k| SeenStone {
            centroid: place(k),
            normal: Vector3::x(),
            sights: (0..6)
                .map(|source| SourcePoints {
                    source,
                    count: 100 + source as u64,
                    time_s: 10.0 * source as f64 + place(k).y,
                    points: Cloud::new(place(k), Vec::new()),
                })
                .collect(),
        })
        .collect();
    let pair = EpochPair::new(&sources, &stones, 0.001);
    let class = SensorClass::Terrestrial;
    let sights: Vec<Sight> = weighted.iter().flat_map(|o| o.sights.clone()).collect();
    let unknowns = Unknowns::new(&sources, &sights, class);
    let components = ObserverComponents::expected(SensorClass::Airborne);
    let model = Model {
        components,
        whole: Matrix3::identity() * 1e-6,
        open: Matrix3::identity() * 25e-6,
        plane_m: 0.0,
        class,
    };
    let (prior, _) = model.scaled(1.0);
    let all = influences(
        &pair,
        &unknowns,
        &weighted,
        (&model, components.translation_m),
        |_| Datum::Sources,
    );
    assert_eq!(all.len(), 6);

    let listed: Vec<&Observation> = weighted.iter().collect();
    let (total, _) = dense(&unknowns, &listed, &prior, &components);
    let precision = total.try_inverse().unwrap();
    let solve = |list: &[&Observation]| Problem::new(&unknowns, list).mean(&prior, &components).unwrap();
    let with = solve(&listed);
    for influence in &all {
        let Member::Source(source) = influence.of else {
            panic!("there are no areas")
        };
        let kept =
            |o: &Observation| -> Vec<usize> { (0..3).filter(|k| o.sights[*k].source != source).collect() };
        let rest: Vec<Observation> = weighted.iter().map(|o| o.among(&kept(o))).collect();
        let change = solve(&rest.iter().collect::<Vec<_>>()) - &with;

        // Offsets of the source in all differences, and the redundancy of those that it takes away.
        let rows: usize = weighted.iter().map(Observation::len).sum();
        let mut offset = DMatrix::zeros(rows, 3);
        let (mut redundancy, mut at) = (0.0, 0);
        for (o, rest) in weighted.iter().zip(&rest) {
            if let Some(own) = o.sights.iter().position(|s| s.source == source) {
                let of_sight = |k: usize| {
                    DMatrix::from_fn(3, 6, |r, c| f64::from(u8::from(k > 0 && c == 3 * (k - 1) + r)))
                };
                let signs = if own == 0 {
                    [-1.0, -1.0]
                } else {
                    [f64::from(2 - own as u8), f64::from(own as u8 - 1)]
                };
                for (k, sign) in signs.into_iter().enumerate() {
                    offset.view_mut((at + 3 * k, 0), (3, 3)).fill_diagonal(sign);
                }
                let noise = |o: &Observation| o.covariance(components.noise_scale, components.nugget_m);
                let residual = noise(o) * precision.view((at, at), (6, 6));
                redundancy += residual.trace();
                let [first, second] = kept(o)[..] else {
                    panic!("three sights")
                };
                let difference = of_sight(second) - of_sight(first);
                let left = &difference * residual * noise(o) * difference.transpose();
                redundancy -= (left * noise(rest).try_inverse().unwrap()).trace();
            }
            at += o.len();
        }
        let near = |found: f64, expected: f64| (found - expected).abs() < 1e-6 * expected.abs();
        assert!(
            near(influence.redundancy, redundancy),
            "{} {redundancy}",
            influence.redundancy
        );
        let information = offset.transpose() * &precision * &offset;
        let variance = information.symmetric_eigenvalues().min().recip();
        let blunder = 4.13 * variance.sqrt();
        assert!(
            near(influence.smallest_blunder_m.unwrap(), blunder),
            "{influence:?} {blunder}"
        );

        // The error at a stone that the others show.
        for (stone, shift) in stones.iter().zip(influence.shifts.as_ref().unwrap()) {
            let counts = |epoch: usize| -> f64 {
                let own = stone
                    .sights
                    .iter()
                    .filter(|s| s.source != source && s.source / 3 == epoch);
                own.map(|s| s.count as f64).sum()
            };
            let mut error = Vector3::zeros();
            for s in stone.sights.iter().filter(|s| s.source != source) {
                let epoch = s.source / 3;
                let share = s.count as f64 / counts(epoch) * if epoch == 1 { 1.0 } else { -1.0 };
                for (first, by) in unknowns.row(&sight(s.source, stone.centroid)) {
                    error += by * change.fixed_rows::<3>(first) * share;
                }
            }
            assert!((shift.unwrap() + error).amax() < 1.5e-6, "{shift:?} {error}");
        }
    }
}
