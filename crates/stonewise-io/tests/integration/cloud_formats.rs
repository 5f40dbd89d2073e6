//! Reads one small cloud in every format, written by other programs (see `testdata/clouds`).

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};
use stonewise_core::id::StoneId;
use stonewise_io::cloud::{
    CloudError, CloudFormat, LabelColumns, PointChunk, PointLabel, PointMotion, ReadSummary, cloud_info,
    cloud_scans, read_cloud, write_labelled,
};

const POINTS: u64 = 120;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata/clouds")
        .join(name)
}

fn position(i: u64) -> Point3<f64> {
    let n = i as f64;
    let z = 100.0 + (i * i % 97) as f64 / 1000.0;
    Point3::new(350_000.0 + n / 100.0, 5_650_000.0 - n / 50.0, z)
}

fn color(i: u64) -> [u16; 3] {
    [500 * i, 65535 - 500 * i, 257 * (i % 256)].map(|c| c as u16)
}

/// All points of a file as one chunk, read `step` at a time.
fn read_all(path: &Path, step: usize) -> (PointChunk, ReadSummary) {
    let mut all = PointChunk::default();
    let summary = read_cloud(path, step, |chunk| {
        assert!(chunk.len() <= step);
        assert_eq!(chunk.indices.len(), chunk.len());
        all.indices.extend(&chunk.indices);
        all.positions.extend(&chunk.positions);
        if let Some(colors) = &chunk.colors {
            assert_eq!(colors.len(), chunk.len());
            all.colors.get_or_insert_default().extend(colors);
        }
        if let Some(intensities) = &chunk.intensities {
            assert_eq!(intensities.len(), chunk.len());
            all.intensities.get_or_insert_default().extend(intensities);
        }
        Ok::<(), CloudError>(())
    })
    .unwrap();
    (all, summary)
}

/// Which columns a fixture has, and with how many bits.
struct Expected {
    color_bits: u32,
    intensity: bool,
    tolerance_m: f64,
}

fn check(name: &str, expected: &Expected) {
    for step in [7, 50, 1000] {
        let (all, summary) = read_all(&fixture(name), step);
        assert_eq!(
            (summary.records, summary.skipped),
            (POINTS, 0),
            "{name}, step {step}"
        );
        assert!(all.indices.iter().copied().eq(0..POINTS), "{name}");
        for (i, p) in (0..).zip(&all.positions) {
            let error = (p - position(i)).amax();
            assert!(error <= expected.tolerance_m, "{name}: point {i} off by {error}");
        }
        let colors = (0..POINTS).map(|i| {
            color(i).map(|c| match expected.color_bits {
                8 => c / 257 * 257,
                _ => c,
            })
        });
        let colors: Vec<_> = colors.collect();
        assert_eq!(all.colors, (expected.color_bits > 0).then_some(colors), "{name}");
        let intensities = (0..POINTS).map(|i| 7.0 * i as f32).collect();
        assert_eq!(
            all.intensities,
            expected.intensity.then_some(intensities),
            "{name}"
        );
    }
    let info = cloud_info(&fixture(name)).unwrap();
    assert_eq!(info.records, POINTS);
    let bounds = info.bounds.unwrap();
    let (low, high) = (
        Point3::new(350_000.0, 5_649_997.62, 100.0),
        Point3::new(350_001.19, 5_650_000.0, 100.096),
    );
    assert!((bounds.min - low).amax() < 1e-6, "{name}: {bounds:?}");
    assert!((bounds.max - high).amax() < 1e-6, "{name}: {bounds:?}");
}

#[test]
fn every_version_and_format_of_las() {
    for (name, color_bits) in [
        ("las10_format1.las", 0),
        ("las11_format0.las", 0),
        ("las12_format2.laz", 16),
        ("las12_format3.las", 16),
        ("las13_format1.laz", 0),
        ("las14_format6.laz", 0),
        ("las14_format7_extra.laz", 16),
        ("las14_format8.las", 16),
        ("chunks.copc.laz", 16),
    ] {
        let expected = Expected {
            color_bits,
            intensity: true,
            tolerance_m: 1e-9,
        };
        check(name, &expected);
    }
}

#[test]
fn every_encoding_of_ply() {
    for name in ["text.ply", "little.ply", "big.ply"] {
        let expected = Expected {
            color_bits: 8,
            intensity: true,
            tolerance_m: 1e-9,
        };
        check(name, &expected);
    }
}

#[test]
fn scans_of_ptx_are_put_in_the_world_and_have_their_scanners() {
    let path = fixture("two_scans.ptx");
    for step in [7, 50, 1000] {
        let (all, summary) = read_all(&path, step);
        assert_eq!((summary.records, summary.skipped), (POINTS + 12, 12));
        // Every eleventh place of the grid has no echo.
        let with_echo = (0..POINTS + 12).filter(|index| index % 11 != 10);
        assert!(all.indices.iter().copied().eq(with_echo));
        let (colors, intensities) = (all.colors.unwrap(), all.intensities.unwrap());
        for (i, p) in (0..POINTS).zip(&all.positions) {
            assert!((p - position(i)).amax() < 2e-9, "point {i}: {p}");
            let k = i as usize;
            assert_eq!(colors[k], color(i).map(|c| c / 257 * 257));
            assert!((intensities[k] - 7.0 * i as f32 / 1000.0).abs() < 1e-6);
        }
    }
    let info = cloud_info(&path).unwrap();
    assert_eq!(info.format, CloudFormat::Ptx);
    let scans: Vec<_> = info.scans.iter().map(|s| (s.name.as_str(), s.records)).collect();
    assert_eq!(scans, [("scan 1", 77), ("scan 2", 55)]);
    assert_eq!(
        info.scans[1].origin,
        Some(Point3::new(350_020.0, 5_649_980.0, 99.25))
    );
    let mut scans = Vec::new();
    read_cloud(&path, 1000, |chunk| {
        scans.extend((!chunk.is_empty()).then_some((chunk.scan, chunk.len())));
        Ok::<(), CloudError>(())
    })
    .unwrap();
    assert_eq!(scans, [(Some(0), 70), (Some(1), 50)]);
}

/// The head of a scan whose scanner stands at `place`, turned a quarter to the left, with one column.
fn ptx_head(rows: usize, place: &str, shift: &str) -> String {
    format!("1\n{rows}\n{place}\n1 0 0\n0 1 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n{shift} 1\n")
}

#[test]
fn scanners_of_ptx_stand_where_a_line_or_the_transformation_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ptx");
    let mut text = String::new();
    for (place, shift) in [
        ("5 6 7", "5 6 7"),
        ("0 0 0", "5 6 7"),
        ("5 6 7", "0 0 0"),
        ("0 0 0", "0 0 0"),
    ] {
        text += &(ptx_head(2, place, shift) + "0 0 0 0.5\n1 2 3 0.25\n");
    }
    std::fs::write(&path, text).unwrap();
    let (all, summary) = read_all(&path, 10);
    assert_eq!((summary.records, summary.skipped), (8, 4));
    let expected = [
        [3.0, 7.0, 10.0],
        [3.0, 7.0, 10.0],
        [-2.0, 1.0, 3.0],
        [-2.0, 1.0, 3.0],
    ];
    assert_eq!(all.positions, expected.map(Point3::from));
    assert_eq!(all.intensities, Some(vec![0.25; 4]));
    let place = Some(Point3::new(5.0, 6.0, 7.0));
    let origins: Vec<_> = cloud_scans(&path).unwrap().iter().map(|s| s.origin).collect();
    assert_eq!(origins, [place, place, place, None]);
}

#[test]
fn scans_of_pts_are_kept_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pts");
    std::fs::write(&path, "2\n1 2 3 -900\n4 5 6 40\n1\n7 8 9 2047\n").unwrap();
    let (all, summary) = read_all(&path, 10);
    assert_eq!((summary.records, summary.skipped), (3, 0));
    assert_eq!(all.intensities, Some(vec![-900.0, 40.0, 2047.0]));
    let mut scans = Vec::new();
    read_cloud(&path, 10, |chunk| {
        scans.push((chunk.scan, chunk.len()));
        Ok::<(), CloudError>(())
    })
    .unwrap();
    assert_eq!(scans, [(Some(0), 2), (Some(1), 1)]);
    let records: Vec<u64> = cloud_scans(&path).unwrap().iter().map(|s| s.records).collect();
    assert_eq!(records, [2, 1]);
    // Intensities from below zero are shifted to fit LAS.
    let out = folder.path().join("out.laz");
    write_labelled(&path, &out, LabelColumns::Stone, no_labels).unwrap();
    assert_eq!(read_all(&out, 10).0.intensities, Some(vec![0.0, 940.0, 2947.0]));
}

#[test]
fn text_with_and_without_a_header() {
    for (name, color_bits, intensity) in [
        ("plain.xyz", 8, false),
        ("tabs.txt", 0, true),
        ("header.csv", 8, false),
        ("german.csv", 0, true),
        ("count.pts", 8, true),
    ] {
        let expected = Expected {
            color_bits,
            intensity,
            tolerance_m: 1e-9,
        };
        check(name, &expected);
    }
}

#[test]
fn scans_of_e57_are_put_in_the_world() {
    let path = fixture("two_scans.e57");
    for step in [7, 50, 1000] {
        let (all, summary) = read_all(&path, step);
        assert_eq!((summary.records, summary.skipped), (POINTS + 3, 3));
        assert!(all.indices.iter().copied().eq((0..70).chain(73..POINTS + 3)));
        for (i, p) in (0..).zip(&all.positions) {
            // Local coordinates have single precision, up to 23 m from the station.
            assert!((p - position(i)).amax() < 2e-6, "point {i}");
            assert_eq!(
                all.colors.as_ref().unwrap()[i as usize][0] / 257,
                color(i)[0] / 257
            );
        }
    }
    let info = cloud_info(&path).unwrap();
    assert_eq!(info.format, CloudFormat::E57);
    let names: Vec<&str> = info.scans.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["station 1", "station 2"]);
    assert_eq!(info.scans[1].records, 53);
    assert_eq!(
        info.scans[0].origin,
        Some(Point3::new(349_990.0, 5_650_010.0, 101.5))
    );
    let mut scans = Vec::new();
    read_cloud(&path, 1000, |chunk| {
        scans.push((chunk.scan, chunk.len()));
        Ok::<(), CloudError>(())
    })
    .unwrap();
    assert_eq!(scans, [(Some(0), 70), (Some(1), 50)]);
}

#[test]
fn coordinate_systems_are_found_in_every_place() {
    let crs = |name: &str| cloud_info(&fixture(name)).unwrap().crs;
    assert!(
        crs("las14_format6.laz")
            .unwrap()
            .starts_with("PROJCS[\"ETRS89 / UTM zone 32N\"")
    );
    // The second of two extended records.
    assert!(crs("chunks.copc.laz").unwrap().ends_with("UNIT[\"metre\",1]]"));
    assert_eq!(crs("las12_format3.las").as_deref(), Some("EPSG:25832"));
    assert_eq!(crs("las10_format1.las"), None);
}

#[test]
fn the_callers_error_ends_the_pass() {
    #[derive(Debug)]
    enum Stop {
        Cloud,
        Enough,
    }
    impl From<CloudError> for Stop {
        fn from(_: CloudError) -> Self {
            Self::Cloud
        }
    }
    for name in [
        "las12_format3.las",
        "little.ply",
        "plain.xyz",
        "two_scans.e57",
        "two_scans.ptx",
    ] {
        let mut seen = 0;
        let ended = read_cloud(&fixture(name), 10, |chunk| {
            seen += chunk.len();
            if seen >= 20 { Err(Stop::Enough) } else { Ok(()) }
        });
        assert!(matches!(ended, Err(Stop::Enough)), "{name}");
        assert_eq!(seen, 20, "{name}");
    }
    assert!(matches!(
        read_cloud(&fixture("none.las"), 10, |_| Ok::<(), Stop>(())),
        Err(Stop::Cloud)
    ));
}

fn no_labels(chunk: &PointChunk) -> Result<Vec<PointLabel>, CloudError> {
    Ok(vec![PointLabel::default(); chunk.len()])
}

/// Labels and motions that follow from the index of a record: two of three have a stone, one of them a motion.
pub fn labels_by_index(chunk: &PointChunk) -> Result<Vec<PointLabel>, CloudError> {
    let label = |&index: &u64| PointLabel {
        stone: (!index.is_multiple_of(3)).then_some(StoneId(index as u32)),
        motion: (index % 3 == 2).then_some(PointMotion {
            displacement_m: Vector3::new(index as f32, 0.02, -0.05),
            significant: index.is_multiple_of(2),
        }),
        ..PointLabel::default()
    };
    Ok(chunk.indices.iter().map(label).collect())
}

#[test]
fn a_labelled_copy_of_las_keeps_records_and_descriptions() {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "las10_format1.las",
        "las11_format0.las",
        "las12_format2.laz",
        "las12_format3.las",
        "las13_format1.laz",
        "las14_format6.laz",
        "las14_format7_extra.laz",
        "las14_format8.las",
        "chunks.copc.laz",
    ] {
        let out = folder.path().join("out.laz");
        write_labelled(&fixture(name), &out, LabelColumns::Stone, no_labels).unwrap();
        let mut before = las::Reader::from_path(fixture(name)).unwrap();
        let mut after = las::Reader::from_path(&out).unwrap();
        assert_eq!(after.header().transforms(), before.header().transforms());
        let (a, b) = (before.read_all().unwrap(), after.read_all().unwrap());
        assert_eq!((a.len(), b.len()), (120, 120), "{name}");
        // The dimension stone_id of one byte gives way to the new one of four.
        let replaced = if name.contains("extra") { 1 } else { 0 };
        let kept = a.record_len() - replaced;
        assert_eq!(b.record_len(), kept + 4, "{name}");
        for (x, y) in a
            .raw_bytes()
            .chunks(a.record_len())
            .zip(b.raw_bytes().chunks(b.record_len()))
        {
            assert_eq!((&y[..kept], &y[kept..]), (&x[..kept], &[0; 4][..]), "{name}");
        }
        let (old, new) = (cloud_info(&fixture(name)).unwrap(), cloud_info(&out).unwrap());
        assert_eq!((new.crs, new.bounds), (old.crs, old.bounds), "{name}");
        let own = |r: &&las::Vlr| r.user_id == "some program";
        assert_eq!(
            after.header().all_vlrs().find(own),
            before.header().all_vlrs().find(own)
        );
        assert!(after.header().all_vlrs().all(|r| r.user_id != "copc"));
    }
}

#[test]
fn a_labelled_copy_of_other_formats_keeps_order_color_and_intensity() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.laz");
    for name in ["little.ply", "header.csv", "count.pts", "two_scans.e57"] {
        write_labelled(&fixture(name), &out, LabelColumns::StoneAndMotion, no_labels).unwrap();
        let (before, _) = read_all(&fixture(name), 1000);
        let (after, summary) = read_all(&out, 1000);
        assert_eq!((summary.records, summary.skipped), (POINTS, 0));
        for (p, q) in before.positions.iter().zip(&after.positions) {
            assert!((p - q).amax() < 0.5001e-4, "{name}");
        }
        assert_eq!(after.colors, before.colors, "{name}");
        if let Some(intensities) = before.intensities.filter(|_| !name.ends_with("e57")) {
            assert_eq!(after.intensities.unwrap(), intensities, "{name}");
        }
    }
}

#[test]
fn labels_and_motions_stand_behind_each_record() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("labelled.laz");
    let input = fixture("las14_format7_extra.laz");
    write_labelled(&input, &out, LabelColumns::StoneAndMotion, labels_by_index).unwrap();
    let data = las::Reader::from_path(&out).unwrap().read_all().unwrap();
    for (i, record) in data.raw_bytes().chunks(data.record_len()).enumerate() {
        // 36 bytes of format 7, 4 + 12 of the input's own dimensions.
        let own = &record[52..];
        let stone = if i.is_multiple_of(3) { 0 } else { i as u32 };
        assert_eq!(own[..4], stone.to_le_bytes());
        let [dx, dy, dz] = [4, 8, 12].map(|at| f32::from_le_bytes(own[at..at + 4].try_into().unwrap()));
        if i % 3 == 2 {
            assert_eq!([dx, dy, dz], [i as f32, 0.02, -0.05]);
        } else {
            assert!(dx.is_nan() && dy.is_nan() && dz.is_nan());
        }
        assert_eq!(
            own[16..],
            u16::from(i % 3 == 2 && i.is_multiple_of(2)).to_le_bytes()
        );
    }
    if let Some(folder) = std::env::var_os("STONEWISE_KEEP").map(PathBuf::from) {
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::copy(&out, folder.join("labelled.laz")).unwrap();
    }
}
