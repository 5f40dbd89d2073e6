use super::*;
use nalgebra::Matrix3;
use std::fs;

const GAMA: &str = include_str!("../../../../testdata/network/adjusted.xml");

/// Covariance of the vectors that `testdata/network/make.py` adjusts, x north, y east, mm^2.
const OBSERVED: [[f64; 3]; 3] = [[1.0, 0.3, 0.0], [0.3, 4.0, -0.2], [0.0, -0.2, 0.25]];

/// Reads files of these names; the first is the network.
fn read(files: &[(&str, &str)]) -> Result<Network, String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    read_network(&folder.path().join(files[0].0)).map_err(|e| {
        let folder = format!("{}/", folder.path().display());
        e.to_string().replace(&folder, "")
    })
}

/// Covariance of two points, x east, mm^2.
fn between(network: &Network, points: [usize; 2]) -> Matrix3<f64> {
    let row = |point: usize, axis: usize| network.points[points[point]].adjusted[axis].unwrap().row;
    Matrix3::from_fn(|r, c| 1e6 * network.covariance[(row(0, r), row(1, c))])
}

/// The adjustment by its condition: A + l1 + l2 and B + l3 differ by 1, -2 and 0.5 mm along north, east and up, of which
/// the variances 1 : 4 : 1 give a sixth to either target. Each is then known to 5/6 of its vector's covariance, and
/// they share a sixth.
#[test]
fn coordinates_of_gama_and_their_covariance_are_those_of_the_condition() {
    let network = read(&[("adjusted.xml", GAMA)]).unwrap();
    let names: Vec<&str> = network.points.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["T1", "T2"]);
    for (point, expected) in network.points.iter().zip([
        [502.0 + 0.002 / 6.0, 103.001 - 0.001 / 6.0, 11.0 - 0.0005 / 6.0],
        [504.0 - 0.002 / 6.0, 105.0 + 0.001 / 6.0, 12.0 + 0.0005 / 6.0],
    ]) {
        assert!((point.place - Point3::from(expected)).norm() < 1e-6, "{point:?}");
        let values = point.adjusted.map(|c| c.unwrap().value_m);
        assert_eq!(values, <[f64; 3]>::from(point.place));
    }
    let swap = [1, 0, 2];
    let observed = Matrix3::from_fn(|r, c| OBSERVED[swap[r]][swap[c]]);
    for (points, share) in [([0, 0], 5.0), ([1, 1], 5.0), ([0, 1], 1.0)] {
        let found = between(&network, points);
        assert!(
            (found - observed * share / 6.0).norm() < 1e-6,
            "{points:?}: {found}"
        );
    }
}

#[test]
fn axes_of_gama_are_turned_to_the_east_and_the_north() {
    // Of T1: where it lies, and the covariance of east and north, mm^2. Angles to the other side turn its sign.
    for (axes, east, north, shared) in [
        ("ne", 502.000333, 103.000833, 0.25),
        ("es", 103.000833, -502.000333, -0.25),
        ("sw", -502.000333, -103.000833, 0.25),
        ("wn", -103.000833, 502.000333, -0.25),
        ("en", 103.000833, 502.000333, -0.25),
        ("nw", -502.000333, 103.000833, 0.25),
    ] {
        let text = GAMA.replace("\"ne\"", &format!("\"{axes}\""));
        let network = read(&[("adjusted.xml", &text)]).unwrap();
        let place = network.points[0].place;
        assert!(
            (place.x - east).abs() < 1e-9 && (place.y - north).abs() < 1e-9,
            "{axes}"
        );
        assert!(
            (between(&network, [0, 0])[(0, 1)] - shared).abs() < 1e-6,
            "{axes}"
        );
    }
    let text = GAMA.replace("left-handed", "right-handed");
    let network = read(&[("adjusted.xml", &text)]).unwrap();
    let found = between(&network, [0, 0]);
    assert!((found[(0, 1)] + 0.25).abs() < 1e-6 && (found[(0, 0)] - 4.0 * 5.0 / 6.0).abs() < 1e-6);
}

#[test]
fn jag3d_and_a_plain_table_give_the_network_of_gama() {
    let gama = read(&[("adjusted.xml", GAMA)]).unwrap();
    let places: Vec<Point3<f64>> = gama.points.iter().map(|p| p.place).collect();
    let (mut info, mut table) = (String::new(), "name,x,y,z\n".to_owned());
    // JAG3D: the second point first, another unknown in the first column of the matrix.
    let column = |point: usize, axis: usize| 1 + 3 * (1 - point) + [1, 0, 2][axis];
    for point in [1, 0] {
        for (letter, axis) in [("X", 1), ("Y", 0), ("Z", 2)] {
            info += &format!(
                "{:>25}\t{letter:>5}\t{:35.15}\t{:10}\t{:10}\n",
                gama.points[point].name,
                places[point][axis],
                column(point, axis),
                2
            );
        }
    }
    let mut whole = DMatrix::from_element(7, 7, 1e-8);
    let mut triangle = DMatrix::zeros(6, 6);
    for points in [[0, 0], [0, 1], [1, 0], [1, 1]] {
        let block = between(&gama, points) * 1e-6;
        for (r, c) in (0..9).map(|k| (k / 3, k % 3)) {
            whole[(column(points[0], r), column(points[1], c))] = block[(r, c)];
            triangle[(3 * points[0] + r, 3 * points[1] + c)] = block[(r, c)];
        }
    }
    let row = |values: Vec<f64>| {
        let cells: Vec<String> = values.iter().map(|v| format!("{v:+35.25}  ")).collect();
        cells.concat() + "\n"
    };
    let cxx: String = (0..7)
        .map(|r| row(whole.row(r).iter().copied().collect()))
        .collect();
    let cov: String = (0..6)
        .map(|r| row(triangle.row(r).columns(0, r + 1).iter().copied().collect()))
        .collect();
    for (name, place) in [("T1", places[0]), ("T2", places[1])] {
        table += &format!("{name},{},{},{}\n", place.x, place.y, place.z);
    }
    let jag3d = read(&[("net.info", &info), ("net.cxx", &cxx)]).unwrap();
    let plain = read(&[("net.csv", &table), ("net.cov", &cov)]).unwrap();
    assert_eq!(
        [jag3d.files.len(), plain.files.len(), gama.files.len()],
        [2, 2, 1]
    );
    for (network, order) in [(&jag3d, [1, 0]), (&plain, [0, 1])] {
        for k in 0..2 {
            let point = &network.points[k];
            assert_eq!(point.name, gama.points[order[k]].name);
            assert!((point.place - places[order[k]]).norm() < 1e-9);
            let found = between(network, [0, k]) - between(&gama, [order[0], order[k]]);
            assert!(found.norm() < 1e-9, "{found}");
        }
    }
}

#[test]
fn a_plain_table_may_have_values_of_some_axes_alone() {
    let table = "name;x;y;z;dx;dy;dz\nL1;1,5;2;3;;;0,001\nL2;4;5;6;;;0,002\n";
    let network = read(&[("net.csv", table), ("net.cov", "1e-6\n5e-7 2e-6\n")]).unwrap();
    assert_eq!(network.points[0].place, Point3::new(1.5, 2.0, 3.0));
    let expected = AdjustedCoordinate {
        value_m: 0.002,
        row: 1,
    };
    assert_eq!(network.points[1].adjusted, [None, None, Some(expected)]);
    assert_eq!(network.covariance[(0, 1)], 5e-7);
}

#[test]
fn a_network_that_cannot_be_names_file_line_and_fix() {
    let gama = |change: [&str; 2]| {
        assert!(GAMA.contains(change[0]), "{change:?}");
        read(&[("a.xml", &GAMA.replace(change[0], change[1]))]).unwrap_err()
    };
    for (change, message) in [
        (
            ["gama-local-adjustment", "g3"],
            "a.xml:2: <g3> is no result of gama-local",
        ),
        (["\"ne\"", "\"nn\""], "a.xml:4: axes-xy must be ne, sw,"),
        (["\"left-handed\"", "\"\""], "a.xml:4: angles must be left-handed"),
        (
            ["<x>103.000833</x>", "<x>1O3</x>"],
            "a.xml:11: \"1O3\" is no number",
        ),
        (["<id>T2", "<id>T1"], "a.xml:12: T1 is there twice"),
        (
            ["<band>6", "<band>0"],
            "a.xml:17: the covariance is cut to a band of 0: run gama-local with",
        ),
        (["<flt>3.3333333e+00</flt>", ""], "a.xml:17: numbers are missing"),
        (
            ["<flt>8.3333333e-01</flt>", "<flt>-0.8</flt>"],
            "a.xml:17: the covariance is not positive",
        ),
        (["</coordinates>\n", ""], "broken xml"),
    ] {
        let found = gama(change);
        assert!(found.contains(message), "{found}");
    }

    let failed = "<gama-local-adjustment>\n<error category=\"c\"><description>no points</description></error>\n\
                  </gama-local-adjustment>";
    let found = read(&[("a.xml", failed)]).unwrap_err();
    assert_eq!(found, "a.xml:2: gama-local failed: no points");

    let info = "T1\tX\t1.0\t0\t2\nT1\tY\t2.0\t1\t2\n";
    let table = "name,x,y,z\nT1,1,2,3\n";
    let cases: [(&[(&str, &str)], &str); 15] = [
        (
            &[("a.info", info), ("a.cxx", "1 0\n0 1\n")],
            "a.info:1: T1, like every adjusted point, lacks x, y or z",
        ),
        (&[("a.info", info)], "a.cxx:1: cannot be read"),
        (
            &[("a.info", info), ("a.cxx", "1 0\n0\n")],
            "a.cxx:2: 1 numbers in a matrix of 2 rows",
        ),
        (
            &[("a.info", info), ("a.cxx", "1\n")],
            "a.info:2: column 1 is not in",
        ),
        (
            &[("a.info", info), ("a.cxx", "1 0.5\n0 1\n")],
            "a.cxx:1: the covariance is not symmetric",
        ),
        (
            &[("a.info", "T1 X 1.0 0 2\n")],
            "a.info:1: point, axis, coordinate and column",
        ),
        (
            &[("a.info", "T1\tH\t1.0\t0\t2\n")],
            "a.info:1: the axis must be X, Y or Z, not \"H\"",
        ),
        (
            &[("a.csv", table), ("a.cov", "1\n0 1\n")],
            "a.cov:2: 2 rows, and 3 values are adjusted",
        ),
        (
            &[("a.csv", table), ("a.cov", "1\n0 1 0\n")],
            "a.cov:2: 3 numbers in row 2 of a lower triangle",
        ),
        (
            &[("a.csv", table), ("a.cov", "1\n0 1\n0 2 1\n")],
            "a.cov:1: the covariance is not positive",
        ),
        (&[("a.csv", "name,x,y\nT1,1,2\n")], "a.csv:1: no column z"),
        (&[("a.csv", "name,x,y,z\nT1,1,2,\n")], "a.csv:2: T1: z is empty"),
        (
            &[("a.csv", "name,x,y,z\nT1,1,2,3\nT1,1,2,4\n")],
            "a.csv:3: T1 is there twice",
        ),
        (
            &[("a.csv", "name,x,y,z,dx\nT1,1,2,3,\n"), ("a.cov", "")],
            "a.csv:1: no point is adjusted",
        ),
        (&[("a.dat", "")], "a.dat:1: no adjusted network"),
    ];
    for (files, message) in cases {
        let found = read(files).unwrap_err();
        assert!(found.contains(message), "{found}");
    }
}
