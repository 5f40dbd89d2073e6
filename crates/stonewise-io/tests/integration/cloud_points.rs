//! New LAZ files read back by another crate, and E57 files that only Rust writes here.

use std::path::{Path, PathBuf};

use e57::{DateTime, E57Writer, Quaternion, Record, RecordValue, Transform, Translation};
use las::Reader;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use stonewise_core::geometry::Bounds;
use stonewise_io::cloud::{
    CloudError, Dimension, ExtraColumn, ExtraType, Observed, cloud_info, read_cloud, stream_coloured_laz,
    stream_points_laz, stream_scan_laz, write_points_laz,
};

/// Keeps a file for `testdata/clouds/check_written.py`, where an environment variable names its folder.
fn keep(path: &Path) {
    if let Some(folder) = std::env::var_os("STONEWISE_KEEP").map(PathBuf::from) {
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::copy(path, folder.join(path.file_name().unwrap())).unwrap();
    }
}

#[test]
fn points_that_come_in_pieces_make_the_same_file_and_strays_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, pieces) = (folder.path().join("whole.laz"), folder.path().join("pieces.laz"));
    let points: Vec<_> = (0..1000)
        .map(|i| Point3::new(f64::from(i) * 0.01, 2.0, -1.0))
        .collect();
    let ids: Vec<u32> = (0..1000).collect();
    let stone = Dimension::new("stone_id", "", "stone");
    write_points_laz(&whole, None, &points, &[(stone, ExtraColumn::U32(&ids))]).unwrap();
    let bounds = Bounds::of(points.iter().copied()).unwrap();
    let columns = [(stone, ExtraType::U32)];
    stream_points_laz(&pieces, None, &bounds, &columns, |sink| {
        for (p, i) in points.chunks(300).zip(ids.chunks(300)) {
            sink.append(p, &[ExtraColumn::U32(i)])?;
        }
        Ok::<(), CloudError>(())
    })
    .unwrap();
    assert_eq!(std::fs::read(&whole).unwrap(), std::fs::read(&pieces).unwrap());

    let refused = |positions: &[Point3<f64>], values: &[ExtraColumn<'_>]| {
        let path = folder.path().join("refused.laz");
        let result = stream_points_laz(&path, None, &bounds, &columns, |sink| {
            sink.append(positions, values)
        });
        assert!(!path.exists());
        result.unwrap_err().to_string()
    };
    let outside = [Point3::new(0.0, 2.1, -1.0)];
    assert!(refused(&outside, &[ExtraColumn::U32(&ids[..1])]).contains("outside"));
    assert!(refused(&points[..1], &[ExtraColumn::F64(&[1.0])]).contains("dimensions"));
    assert!(refused(&points[..2], &[ExtraColumn::U32(&ids[..1])]).contains("1 values"));
}

#[test]
fn sources_and_times_of_a_scan_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.laz");
    let points: Vec<_> = (0..500)
        .map(|i| Point3::new(f64::from(i) * 0.01, 2.0, -1.0))
        .collect();
    let sources: Vec<u16> = (0..500).map(|i| 1 + i / 200).collect();
    let times: Vec<f64> = (0..500).map(|i| 428_652_818.25 + f64::from(i) * 5e-6).collect();
    let bounds = Bounds::of(points.iter().copied()).unwrap();
    stream_scan_laz(&path, &bounds, &[], |sink| {
        let short = Observed {
            sources: &sources[1..],
            times: &times,
        };
        assert!(sink.append_observed(&points, short, &[]).is_err());
        let observed = Observed {
            sources: &sources,
            times: &times,
        };
        sink.append_observed(&points, observed, &[])
    })
    .unwrap();
    let mut reader = Reader::from_path(&path).unwrap();
    assert!(reader.header().gps_time_type().is_standard());
    let data = reader.read_all().unwrap();
    assert!(data.point_source_id().eq(sources));
    assert!(data.gps_time().unwrap().eq(times));
}

#[test]
fn coloured_points_come_back_with_their_numbers_and_system() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stones.laz");
    let wkt = "PROJCS[\"x\",AUTHORITY[\"EPSG\",\"25832\"]]";
    let at = |i: u32| {
        Point3::new(
            451_000.0 + f64::from(i) * 0.0101,
            5_601_000.0,
            310.25 - f64::from(i),
        )
    };
    let points: Vec<_> = (0..900).map(at).collect();
    let colours: Vec<[u8; 3]> = (0..900u32).map(|i| [(i % 256) as u8, 0, 255]).collect();
    let numbers: Vec<f32> = (0..900u16).map(f32::from).collect();
    let bounds = Bounds::of(points.iter().copied()).unwrap();
    let columns = [(Dimension::new("place", "", "number of the point"), ExtraType::F32)];
    stream_coloured_laz(&path, Some(wkt), &bounds, &columns, |sink| {
        let all = [ExtraColumn::F32(&numbers)];
        assert!(sink.append(&points, &all).is_err());
        assert!(sink.append_coloured(&points, &colours[1..], &all).is_err());
        for part in [0..400, 400..900] {
            let number = ExtraColumn::F32(&numbers[part.clone()]);
            sink.append_coloured(&points[part.clone()], &colours[part], &[number])?;
        }
        Ok::<(), CloudError>(())
    })
    .unwrap();
    let mut reader = Reader::from_path(&path).unwrap();
    assert_eq!(cloud_info(&path).unwrap().crs.as_deref(), Some(wkt));
    let mut read = 0;
    let written = reader.read_all().unwrap();
    for (i, point) in written.points().map(Result::unwrap).enumerate() {
        assert!((Point3::new(point.x, point.y, point.z) - points[i]).amax() < 0.51e-4);
        let colour = point.color.unwrap();
        assert_eq!(
            [colour.red, colour.green, colour.blue],
            colours[i].map(|c| u16::from(c) * 257)
        );
        assert_eq!(point.extra_bytes, numbers[i].to_le_bytes());
        read += 1;
    }
    assert_eq!(read, 900);
}

#[test]
fn core_points_come_back_with_their_dimensions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m3c2.laz");
    let n = 120_000;
    let point = |i: usize| Point3::new(4e5 + i as f64 * 0.001_234, 5e6 - i as f64 * 0.01, 90.123_456);
    let points: Vec<_> = (0..n).map(point).collect();
    let distance: Vec<f64> = (0..n).map(|i| i as f64 / 7.0).collect();
    let spread: Vec<f32> = (0..n).map(|i| i as f32 / 3.0).collect();
    let count: Vec<u32> = (0..n as u32).rev().collect();
    let flag: Vec<u16> = (0..n).map(|i| (i % 2) as u16).collect();
    let columns = [
        (
            Dimension::new("m3c2_distance", "m", "distance along the normal"),
            ExtraColumn::F64(&distance),
        ),
        (
            Dimension::new("m3c2_std_dev1", "m", "spread"),
            ExtraColumn::F32(&spread),
        ),
        (
            Dimension::new("m3c2_count1", "", "points"),
            ExtraColumn::U32(&count),
        ),
        (
            Dimension::new("m3c2_significant", "", "1: significant"),
            ExtraColumn::U16(&flag),
        ),
    ];
    write_points_laz(&path, None, &points, &columns).unwrap();
    let mut reader = Reader::from_path(&path).unwrap();
    let described = reader.header().vlrs().iter().find(|v| v.record_id == 4).unwrap();
    // LAS 1.4 R15, table 24: 192 bytes a dimension, the name from byte 4 and the description from byte 160 on.
    let texts: Vec<[&[u8]; 2]> = described
        .data
        .chunks(192)
        .map(|d| [&d[4..36], &d[160..]].map(|text| text.trim_ascii_end().split(|b| *b == 0).next().unwrap()))
        .collect();
    assert_eq!(
        texts[0],
        [b"m3c2_distance".as_slice(), b"distance along the normal, m"]
    );
    assert_eq!(texts[2], [b"m3c2_count1".as_slice(), b"points"]);
    let data = reader.read_all().unwrap();
    assert_eq!((data.len(), data.record_len()), (n, 30 + 18));
    for (i, record) in data.raw_bytes().chunks(48).enumerate() {
        assert_eq!(record[30..38], distance[i].to_le_bytes());
        assert_eq!(record[38..42], spread[i].to_le_bytes());
        assert_eq!(record[42..46], count[i].to_le_bytes());
        assert_eq!(record[46..48], flag[i].to_le_bytes());
    }
    for (i, p) in data.points().enumerate().step_by(997) {
        let p = p.unwrap();
        assert!((Point3::new(p.x, p.y, p.z) - points[i]).amax() < 0.51e-6);
    }
    let bounds = cloud_info(&path).unwrap().bounds.unwrap();
    assert!((bounds.max.y - 5e6).abs() < 1e-6 && (bounds.min.z - 90.123_456).abs() < 1e-6);
    let first = std::fs::read(&path).unwrap();
    write_points_laz(&path, None, &points, &columns).unwrap();
    assert!(
        std::fs::read(&path).unwrap() == first,
        "the same points gave other bytes"
    );
    keep(&path);
}

#[test]
fn no_points_and_far_points_can_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m3c2.laz");
    write_points_laz(
        &path,
        None,
        &[],
        &[(Dimension::new("d", "m", "x"), ExtraColumn::F32(&[]))],
    )
    .unwrap();
    let info = cloud_info(&path).unwrap();
    assert_eq!((info.records, info.bounds), (0, None));
    assert_eq!(
        read_cloud(&path, 10, |_| Ok::<(), CloudError>(()))
            .unwrap()
            .records,
        0
    );
    let points = [Point3::new(-9e6, 0.0, 0.0), Point3::new(9e6, 1.0, 2.0)];
    write_points_laz(&path, None, &points, &[]).unwrap();
    read_cloud(&path, 10, |chunk| {
        assert!((chunk.positions[1] - points[1]).amax() < 0.01);
        Ok::<(), CloudError>(())
    })
    .unwrap();
    assert!(write_points_laz(&path, None, &[Point3::new(1e300, 0.0, 0.0), points[0]], &[]).is_err());
}

#[test]
fn spherical_coordinates_become_points_in_the_world() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e57");
    let rotation = UnitQuaternion::from_euler_angles(0.1, -0.2, 2.5);
    let translation = Vector3::new(100.0, -50.0, 7.0);
    let (range, azimuth, elevation) = (12.5, 0.75, -0.5);
    let mut writer = E57Writer::from_file(&path, "file").unwrap();
    let prototype = vec![
        Record::SPHERICAL_RANGE_F64,
        Record::SPHERICAL_AZIMUTH_F64,
        Record::SPHERICAL_ELEVATION_F64,
    ];
    let mut scan = writer.add_pointcloud("scan", prototype).unwrap();
    scan.set_transform(Some(Transform {
        rotation: Quaternion {
            w: rotation.w,
            x: rotation.i,
            y: rotation.j,
            z: rotation.k,
        },
        translation: Translation {
            x: translation.x,
            y: translation.y,
            z: translation.z,
        },
    }));
    scan.set_sensor_vendor(Some("Leica Geosystems".to_owned()));
    scan.set_sensor_model(Some("RTC360".to_owned()));
    scan.set_acquisition_start(Some(DateTime {
        gps_time: 1.4e9,
        atomic_reference: false,
    }));
    scan.add_point(vec![
        RecordValue::Double(range),
        RecordValue::Double(azimuth),
        RecordValue::Double(elevation),
    ])
    .unwrap();
    scan.finalize().unwrap();
    writer.finalize().unwrap();

    let local = Vector3::new(
        f64::cos(elevation) * f64::cos(azimuth),
        f64::cos(elevation) * f64::sin(azimuth),
        f64::sin(elevation),
    );
    let expected = Point3::from(rotation * (local * range) + translation);
    read_cloud(&path, 10, |chunk| {
        assert!((chunk.positions[0] - expected).amax() < 1e-12);
        Ok::<(), CloudError>(())
    })
    .unwrap();
    let scan = &cloud_info(&path).unwrap().scans[0];
    assert_eq!(scan.origin, Some(translation.into()));
    assert_eq!(scan.sensor.as_deref(), Some("Leica Geosystems RTC360"));
    assert_eq!(scan.begun_s, Some(1.4e9));
}
