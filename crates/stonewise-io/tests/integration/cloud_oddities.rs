//! Clouds that say odd things of themselves: counts that differ, units, flags, rotations, colours.

use e57::{E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation};
use las::{Builder, Reader, Vlr, Writer, point::Format};
use nalgebra::Point3;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::id::StoneId;
use stonewise_io::cloud::{
    CloudError, LabelColumns, PointChunk, PointLabel, ReadSummary, Remark, cloud_details, cloud_info,
    cloud_remarks, read_cloud, write_labelled,
};
use stonewise_io::crs::{Crs, Units};

const FOOT: f64 = 0.3048;
const US_FOOT: f64 = 1200.0 / 3937.0;

fn fixture(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/clouds");
    fs::read(folder.join(name)).unwrap()
}

/// A file of these bytes, in a folder that lives as long as it.
fn file(name: &str, bytes: impl AsRef<[u8]>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn read(path: &Path) -> (PointChunk, ReadSummary) {
    let mut all = PointChunk::default();
    let summary = read_cloud(path, 50, |chunk| {
        all.indices.extend(&chunk.indices);
        all.positions.extend(&chunk.positions);
        if let Some(colors) = &chunk.colors {
            all.colors.get_or_insert_default().extend(colors);
        }
        if let Some(intensities) = &chunk.intensities {
            all.intensities.get_or_insert_default().extend(intensities);
        }
        Ok::<(), CloudError>(())
    });
    (all, summary.unwrap())
}

fn refusal(path: &Path) -> String {
    cloud_info(path).unwrap_err().to_string()
}

fn texts(remarks: &[Remark], is_doubt: bool) -> Vec<&str> {
    let chosen = remarks.iter().filter(|r| r.is_doubt == is_doubt);
    chosen.map(|r| r.text.as_str()).collect()
}

/// Three points of a LAS file, in units of the file.
fn las(path: &Path, format: u8, change: impl Fn(&mut Builder), point: impl Fn(usize, &mut las::Point)) {
    let mut builder = Builder::from((1, 4));
    builder.point_format = Format::new(format).unwrap();
    change(&mut builder);
    let mut writer = Writer::from_path(path, builder.into_header().unwrap()).unwrap();
    for i in 0..3 {
        let mut p = las::Point {
            x: 10.0 + i as f64,
            y: 20.0,
            z: 30.0 + 2.0 * i as f64,
            gps_time: Some(0.0),
            ..las::Point::default()
        };
        point(i, &mut p);
        writer.write_point(p).unwrap();
    }
    writer.close().unwrap();
}

fn keys(keys: &[(u16, u16)]) -> Vlr {
    let entries = keys.iter().flat_map(|(key, value)| [*key, 0, 1, *value]);
    let words = [1, 1, 0, keys.len() as u16].into_iter().chain(entries);
    Vlr {
        user_id: "LASF_Projection".to_owned(),
        record_id: 34735,
        description: String::new(),
        data: words.flat_map(u16::to_le_bytes).collect(),
    }
}

#[test]
fn the_64_bit_count_holds_for_extended_formats_and_the_legacy_one_for_others() {
    for name in ["las14_format8.las", "las14_format7_extra.laz"] {
        for legacy in [60u32, u32::MAX] {
            let mut bytes = fixture(name);
            bytes[107..111].copy_from_slice(&legacy.to_le_bytes());
            let (_folder, path) = file(name, bytes);
            assert_eq!(read(&path).1.records, 120, "{name}");
            let info = cloud_info(&path).unwrap();
            assert_eq!(info.records, 120);
            let said = texts(&info.remarks, false);
            assert!(
                said[0].contains(&format!("{legacy} and 120 points: 120 are read")),
                "{said:?}"
            );
            assert_eq!((said.len(), info.remarks.len()), (1, 1));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.las");
    las(&path, 1, |_| {}, |_, _| {});
    let mut bytes = fs::read(&path).unwrap();
    bytes[107..111].copy_from_slice(&2u32.to_le_bytes());
    fs::write(&path, bytes).unwrap();
    assert_eq!(read(&path).1.records, 2);
    let remarks = cloud_remarks(&path).unwrap();
    assert!(texts(&remarks, false)[0].contains("2 and 3 points: 2 are read"));
    assert!(texts(&remarks, true)[0].contains("counts 2 points, and there is room for 3"));
}

#[test]
fn points_that_no_count_names_are_a_doubt() {
    for name in ["las14_format8.las", "las14_format7_extra.laz"] {
        let mut bytes = fixture(name);
        bytes[107..111].fill(0);
        bytes[247..255].copy_from_slice(&70u64.to_le_bytes());
        let (_folder, path) = file(name, bytes);
        assert_eq!(read(&path).1.records, 70, "{name}");
        let remarks = cloud_remarks(&path).unwrap();
        assert!(
            texts(&remarks, true)[0].contains("counts 70 points, and there is room for 120"),
            "{remarks:?}"
        );
    }
    for name in [
        "las14_format8.las",
        "las14_format6.laz",
        "chunks.copc.laz",
        "las12_format2.laz",
    ] {
        let (_folder, path) = file(name, fixture(name));
        assert_eq!(cloud_remarks(&path).unwrap(), [], "{name}");
    }
}

#[test]
fn extended_records_behind_the_end_are_named() {
    let mut bytes = fixture("las14_format8.las");
    bytes[235..243].copy_from_slice(&1_000_000_000u64.to_le_bytes());
    bytes[243..247].copy_from_slice(&1u32.to_le_bytes());
    let (_folder, path) = file("a.las", &bytes);
    let said = refusal(&path);
    assert!(
        said.contains("extended records (EVLR)") && said.contains("1000000000"),
        "{said}"
    );
    bytes[25] = 5;
    fs::write(&path, bytes).unwrap();
    assert!(refusal(&path).contains("LAS 1.5 is not supported"));
}

#[test]
fn a_table_of_zeros_is_no_table() {
    for name in ["las12_format2.laz", "las14_format7_extra.laz"] {
        let mut bytes = fixture(name);
        let word = |place: usize| u32::from_le_bytes(bytes[place..place + 4].try_into().unwrap()) as usize;
        let table = word(word(96));
        bytes[table..].fill(0);
        let (_folder, path) = file(name, bytes);
        assert_eq!(read(&path).1.records, 120, "{name}");
    }
}

#[test]
fn coordinates_of_every_unit_are_read_as_metres_and_copied_as_they_are() {
    let unit = |name: &str, unit: &str| {
        let text = format!(
            "PROJCS[\"site\",GEOGCS[\"g\",DATUM[\"D\",SPHEROID[\"GRS 1980\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],\
             UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"false_easting\",1640416.667],\
             UNIT[\"{name}\",{unit}]]"
        );
        Vlr {
            record_id: 2112,
            data: text.into_bytes(),
            ..keys(&[])
        }
    };
    let cases = [
        (
            1,
            keys(&[(1024, 1), (2048, 4269), (3072, 32767), (3076, 9002)]),
            [FOOT; 2],
        ),
        (1, keys(&[(1024, 1), (3072, 26917), (3076, 9003)]), [US_FOOT; 2]),
        (
            1,
            keys(&[(1024, 1), (3072, 26917), (3076, 9001), (4096, 5703), (4099, 9003)]),
            [1.0, US_FOOT],
        ),
        (6, unit("anything", "0.9144"), [0.9144; 2]),
        (6, unit("ft", "1"), [1.0; 2]),
    ];
    for (format, record, [plane_m, height_m]) in cases {
        let folder = tempfile::tempdir().unwrap();
        let (path, copy) = (folder.path().join("a.las"), folder.path().join("b.laz"));
        let add = |builder: &mut Builder| {
            builder.has_wkt_crs = record.record_id == 2112;
            builder.vlrs.push(record.clone());
        };
        las(&path, format, add, |_, _| {});
        let expected = [10.0, 11.0, 12.0].map(|x| [x * plane_m, 20.0 * plane_m, (10.0 + 2.0 * x) * height_m]);
        let near = |found: &Point3<f64>, expected: &[f64; 3]| {
            (found.coords - nalgebra::Vector3::from(*expected)).amax() < 1e-9
        };
        let (all, _) = read(&path);
        assert!(
            all.positions.iter().zip(&expected).all(|(a, b)| near(a, b)),
            "{all:?}"
        );
        let info = cloud_info(&path).unwrap();
        assert_eq!((info.units.plane_m, info.units.height_m), (plane_m, height_m));
        let bounds = info.bounds.unwrap();
        assert!(
            near(&bounds.min, &expected[0]) && near(&bounds.max, &expected[2]),
            "{bounds:?}"
        );
        assert_eq!(cloud_details(&path).unwrap().bounds, Some(bounds));
        // What the positions are in is a system in metres.
        if let Some(text) = &info.crs {
            assert_eq!(Units::of(text), Ok(Units::METRES), "{text}");
            assert!(Crs::parse(text).is_some());
        }

        write_labelled(&path, &copy, LabelColumns::Stone, |chunk| {
            Ok::<_, CloudError>(vec![PointLabel::default(); chunk.len()])
        })
        .unwrap();
        let mut copied = Reader::from_path(&copy).unwrap();
        assert!(copied.header().all_vlrs().any(|v| v.data == record.data));
        let x: Vec<f64> = copied.read_all().unwrap().x().collect();
        assert_eq!(x, [10.0, 11.0, 12.0]);
        assert_eq!(read(&copy).0.positions, all.positions);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.las");
    las(
        &path,
        1,
        |b| b.vlrs.push(keys(&[(3072, 32767), (3076, 9999)])),
        |_, _| {},
    );
    let said = refusal(&path);
    assert!(
        said.contains("unit 9999") && said.contains("transform it to a system in metres"),
        "{said}"
    );
}

#[test]
fn withheld_points_and_noise_are_left_out_and_copied_without_a_stone() {
    for format in [1, 6] {
        let folder = tempfile::tempdir().unwrap();
        let (path, copy) = (folder.path().join("a.las"), folder.path().join("b.laz"));
        for reason in ["withheld", "low", "high"] {
            las(
                &path,
                format,
                |_| {},
                |i, p| match reason {
                    "withheld" => p.is_withheld = i == 1,
                    "low" if i == 1 => p.classification = las::point::Classification::LowPoint,
                    "high" if i == 1 => p.classification = las::point::Classification::HighNoise,
                    _ => {}
                },
            );
            let (all, summary) = read(&path);
            assert_eq!(all.indices, [0, 2], "{format} {reason}");
            assert_eq!((summary.records, summary.skipped, summary.unused), (3, 0, 1));
            write_labelled(&path, &copy, LabelColumns::Stone, |chunk| {
                let label = PointLabel {
                    stone: Some(StoneId(7)),
                    ..PointLabel::default()
                };
                Ok::<_, CloudError>(vec![label; chunk.len()])
            })
            .unwrap();
            let mut copied = Reader::from_path(&copy).unwrap();
            let all = copied.read_all().unwrap();
            let records = all.raw_bytes().chunks(all.record_len());
            let stones: Vec<u8> = records.map(|r| r[r.len() - 4]).collect();
            assert_eq!(stones, [7, 0, 7]);
        }
    }
}

/// Two scans of two points, the second one with this rotation and a translation.
fn e57(path: &Path, w: f64, z: f64, intensities: [f32; 2]) {
    let mut file = E57Writer::from_file(path, "file").unwrap();
    let single = RecordDataType::Single { min: None, max: None };
    let names = [
        RecordName::CartesianX,
        RecordName::CartesianY,
        RecordName::CartesianZ,
        RecordName::Intensity,
    ];
    for scan in ["first", "second"] {
        let records = names.clone().map(|name| Record {
            name,
            data_type: single.clone(),
        });
        let mut cloud = file.add_pointcloud(scan, records.to_vec()).unwrap();
        cloud.set_name(Some(scan.to_owned()));
        if scan == "second" {
            cloud.set_transform(Some(Transform {
                rotation: Quaternion { w, x: 0.0, y: 0.0, z },
                translation: Translation {
                    x: 1000.0,
                    y: 2000.0,
                    z: 0.0,
                },
            }));
        }
        for (x, intensity) in [100.0, 200.0].into_iter().zip(intensities) {
            let values = [x, 0.0, 5.0, intensity].map(RecordValue::Single);
            cloud.add_point(values.to_vec()).unwrap();
        }
        cloud.finalize().unwrap();
    }
    file.finalize().unwrap();
}

#[test]
fn rotations_of_e57_scans_neither_scale_nor_collapse() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e57");
    let second = |path: &Path| [2, 3].map(|i| read(path).0.positions[i]);
    let near = |found: [Point3<f64>; 2], expected: [[f64; 3]; 2]| {
        let errors = found
            .iter()
            .zip(expected)
            .map(|(a, b)| (a - Point3::from(b)).amax());
        assert!(errors.fold(0.0, f64::max) < 1e-9, "{found:?}");
    };
    // A quarter turn to the left, whose cosine is written with three decimals.
    e57(&path, 0.707, 0.707, [100.0, 4000.0]);
    near(second(&path), [[1000.0, 2100.0, 5.0], [1000.0, 2200.0, 5.0]]);
    assert_eq!(cloud_remarks(&path).unwrap(), []);
    // Intensities without limits are not squeezed into the range of all floats.
    assert_eq!(
        read(&path).0.intensities,
        Some(vec![100.0, 4000.0, 100.0, 4000.0])
    );

    e57(&path, 0.0, 0.0, [0.0; 2]);
    near(second(&path), [[1100.0, 2000.0, 5.0], [1200.0, 2000.0, 5.0]]);
    let remarks = cloud_remarks(&path).unwrap();
    assert!(
        texts(&remarks, false)[0].contains("the rotation of second is zero"),
        "{remarks:?}"
    );
    assert_eq!(remarks.len(), 1);

    for (w, z) in [(2.0, 0.0), (0.1, 0.1), (f64::NAN, 0.0)] {
        e57(&path, w, z, [0.0; 2]);
        let said = refusal(&path);
        assert!(
            said.contains("the rotation of second is a quaternion of length"),
            "{said}"
        );
    }
}

/// Positions, colours and intensities.
type Columns = (Vec<[f64; 3]>, Option<Vec<[u16; 3]>>, Option<Vec<f32>>);

/// What is read of a text.
fn text(content: &str) -> Columns {
    let (_folder, path) = file("a.csv", content);
    let all = read(&path).0;
    (
        all.positions.iter().map(|p| [p.x, p.y, p.z]).collect(),
        all.colors,
        all.intensities,
    )
}

fn text_refusal(content: &str) -> String {
    let (_folder, path) = file("a.csv", content);
    refusal(&path)
}

#[test]
fn tables_may_hold_names_empty_cells_and_separators_at_the_end() {
    let expected = vec![[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]];
    for content in [
        "name,x,y,z\nP1,1.5,2.5,3.5\nP2,4.5,5.5,6.5\n",
        "x;y;z;\n1.5;2.5;3.5;\n4.5;5.5;6.5;\n",
        "1.5,2.5,3.5,\n4.5,5.5,6.5,\n",
        "x,y,z,remark\n1.5,2.5,3.5,wall\n4.5,5.5,6.5,\n",
        "1,5\t2,5\t3,5\n4,5\t5,5\t6,5\n",
        "X Y Z\n1,5 2,5 3,5\n4,5 5,5 6,5\n",
        "1.5, 2.5, 3.5\n4.5, 5.5, 6.5\n",
        "# Gr\u{f6}\u{df}e\n1.5 2.5 3.5\n4.5 5.5 6.5\n",
    ] {
        assert_eq!(text(content).0, expected, "{content}");
    }
    let (_folder, path) = file("a.xyz", b"# Gr\xf6\xdfe\n1.5 2.5 3.5\n");
    assert_eq!(read(&path).1.records, 1);
    let said = text_refusal("name,x,y,z\nP1,1.5,2.5,three\n");
    assert!(
        said.contains("line 2") && said.contains("\"three\" in column 4"),
        "{said}"
    );
}

#[test]
fn commas_that_may_be_decimal_signs_and_separators_are_refused() {
    for content in ["400000,1234,5650000,0123,300,1234\n", "x,y,z\n1,5,2,5,3,5\n"] {
        let said = text_refusal(content);
        assert!(said.contains("decimal signs"), "{said}");
    }
    assert_eq!(text("x,y,z,r,g,b\n1,2,3,40,50,60\n").0, [[1.0, 2.0, 3.0]]);
}

#[test]
fn a_header_with_y_before_x_is_read_by_name_and_said() {
    let (_folder, path) = file("a.csv", "Y;X;Z\n400000,5;5650000,5;300,5\n");
    assert_eq!(
        read(&path).0.positions,
        [Point3::new(5_650_000.5, 400_000.5, 300.5)]
    );
    let remarks = cloud_remarks(&path).unwrap();
    assert!(
        texts(&remarks, false)[0].contains("X points east and Y north"),
        "{remarks:?}"
    );
    let (_folder, path) = file("b.csv", "X;Y;Z\n1,5;2,5;3,5\n");
    assert_eq!(cloud_remarks(&path).unwrap(), []);
}

#[test]
fn colours_of_text_are_found_by_the_first_points_and_scaled() {
    let white = |c: u16| [c * 257; 3];
    // CloudCompare's order, and that of PTS.
    let (_, colors, intensities) = text("1.5 2 3 40 50 60 1000\n1.5 2 3 70 80 90 3000\n");
    assert_eq!(colors.unwrap()[0], [40 * 257, 50 * 257, 60 * 257]);
    assert_eq!(intensities.unwrap(), [1000.0, 3000.0]);
    let (_, colors, intensities) = text("1.5 2 3 -900 40 50 60\n1.5 2 3 0.5 70 80 90\n");
    assert_eq!(colors.unwrap()[1], [70 * 257, 80 * 257, 90 * 257]);
    assert_eq!(intensities.unwrap(), [-900.0, 0.5]);
    // The first point is black.
    assert_eq!(
        text("1.5 2 3 0 0 0\n1.5 2 3 9 9 9\n").1.unwrap(),
        [white(0), white(9)]
    );
    // 16 bits, fractions, and normals.
    assert_eq!(
        text("x y z r g b\n1.5 2 3 514 514 514\n1.5 2 3 7 7 7\n")
            .1
            .unwrap(),
        [white(2), [7; 3]]
    );
    assert_eq!(
        text("x y z r g b\n1.5 2 3 1 1 1\n1.5 2 3 0.0 0.5 1.0\n")
            .1
            .unwrap(),
        [white(255), [0, 32768, 65535]]
    );
    assert_eq!(text("1.5 2 3 0 0 1\n1.5 2 3 0 1 0\n").1, None);
}

#[test]
fn floating_colours_of_ply_are_scaled_and_comments_hold_any_bytes() {
    let ply = |comment: &[u8], kind: &str, rows: &str| {
        let head = "ply\nformat ascii 1.0\ncomment ";
        let properties = "element vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
        let colours = ["red", "green", "blue"]
            .map(|c| format!("property {kind} {c}\n"))
            .concat();
        let rest = format!("\n{properties}{colours}end_header\n{rows}");
        let (_folder, path) = file("a.ply", [head.as_bytes(), comment, rest.as_bytes()].concat());
        read(&path).0.colors.unwrap()
    };
    let expected = [[0, 51 * 257, 65535], [0; 3]];
    assert_eq!(
        ply(b"Gr\xf6\xdfe", "float", "1 2 3 0 51 255\n1 2 3 0 0 0\n"),
        expected
    );
    assert_eq!(ply(b"", "float", "1 2 3 0 0.2 1\n1 2 3 0 0 0\n"), expected);
    assert_eq!(ply(b"", "double", "1 2 3 0 13107 65535\n1 2 3 0 0 0\n"), expected);
    assert_eq!(ply(b"", "uchar", "1 2 3 0 51 255\n1 2 3 0 0 0\n"), expected);
}
