//! Files that lie about their sizes are refused at once; files that only lack what is not needed are read.

use nalgebra::Point3;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use stonewise_io::cameras::read_cameras;
use stonewise_io::cloud::{CloudError, cloud_info, measure_cloud, read_cloud, read_mesh};
use stonewise_io::crs::Crs;
use stonewise_io::image_io::read_rgb;
use stonewise_io::masks::{LabelFolder, read_label_png};

fn testdata(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata")
        .join(name)
}

/// Long for a refusal, short for a machine that is busy with other tests.
const AT_ONCE: Duration = Duration::from_millis(500);

fn refusal<T, E: std::fmt::Display>(path: &Path, read: impl FnOnce(&Path) -> Result<T, E>) -> String {
    let started = Instant::now();
    let message = read(path).err().map(|e| e.to_string()).unwrap_or_default();
    let spent = started.elapsed();
    assert!(spent < AT_ONCE, "{spent:?} for {}", path.display());
    let message = message.replace(&format!("{}", path.display()), "FILE");
    assert!(!message.contains('\n'), "{message}");
    message
}

#[test]
fn clouds_that_lie_about_their_sizes_are_refused_at_once() {
    for (name, expected) in [
        (
            "hostile/layer_sizes.laz",
            "FILE: the layers of chunk 1 take 2464074412 bytes, and the chunk has 2919",
        ),
        (
            "hostile/laz_2e60.laz",
            "FILE is cut off: it holds 2971 bytes of points, and its header claims 1152921504606846976 points",
        ),
        (
            "hostile/las_2e60.las",
            "FILE is cut off: it holds 400 of 1152921504606846976 points",
        ),
        (
            "hostile/ply_element_without_properties.ply",
            "FILE: the header claims 18446744073709551615 elements note that have no properties",
        ),
        (
            "hostile/ply_huge_element_at_eof.ply",
            "FILE is cut off: it has room for 0 of the 9000000000000000000 elements note that its header claims",
        ),
    ] {
        assert_eq!(refusal(&testdata(name), measure_cloud), expected);
        assert_eq!(refusal(&testdata(name), cloud_info), expected);
    }
    let mesh = refusal(&testdata("hostile/ply_huge_element_at_eof.ply"), read_mesh);
    assert!(mesh.contains("element"), "{mesh}");
}

#[test]
fn scanner_files_that_lie_about_their_sizes_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let head = |columns: &str| {
        format!(
            "{columns}\n4000000000\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0\n"
        )
    };
    let path = folder.path().join("a.ptx");
    fs::write(&path, head("4000000000")).unwrap();
    let expected = "FILE is cut off: it has room for 1 of the 4000000000 x 4000000000 points that the header of scan 1 claims";
    assert_eq!(refusal(&path, measure_cloud), expected);
    assert_eq!(refusal(&path, cloud_info), expected);
    fs::write(&path, head("18446744073709551616")).unwrap();
    assert!(refusal(&path, cloud_info).contains("line 1: not the number of columns"));
}

/// Points of constants take no bits, so that a file of a kilobyte can claim any number of them.
#[test]
fn a_scan_of_constants_is_refused_at_once() {
    use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("constants.e57");
    let mut file = E57Writer::from_file(&path, "file").unwrap();
    let names = [
        RecordName::CartesianX,
        RecordName::CartesianY,
        RecordName::CartesianZ,
    ];
    let prototype = names.map(|name| Record {
        name,
        data_type: RecordDataType::Integer { min: 5, max: 6 },
    });
    let mut scan = file.add_pointcloud("scan", prototype.to_vec()).unwrap();
    scan.set_name(Some("tower".to_owned()));
    for _ in 0..3 {
        scan.add_point(vec![RecordValue::Integer(5); 3]).unwrap();
    }
    scan.finalize().unwrap();
    // The writer takes no constants.
    let (range, constant) = ("minimum=\"5\" maximum=\"6\"", "minimum=\"5\" maximum=\"5\"");
    file.finalize_customized_xml(|xml| {
        assert_eq!(xml.matches(range).count(), 3, "{xml}");
        Ok(xml.replace(range, constant))
    })
    .unwrap();
    let expected = "FILE: all values of scan tower are constants, so that nothing tells its points apart";
    assert_eq!(refusal(&path, measure_cloud), expected);
    assert_eq!(refusal(&path, cloud_info), expected);
}

#[test]
fn layers_under_a_compressor_without_layers_are_refused_at_once() {
    let mut bytes = std::fs::read(testdata("hostile/layer_sizes.laz")).unwrap();
    // The compressor is the first number of the compression record, which follows the header of 375 bytes and
    // its own of 54.
    let compressor = 375 + 54;
    assert_eq!(bytes[compressor..compressor + 2], [3, 0]);
    bytes[compressor] = 2;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mixed.laz");
    std::fs::write(&path, bytes).unwrap();
    let expected =
        "FILE: the compression record mixes layers with points that have none: write the file again";
    assert_eq!(refusal(&path, measure_cloud), expected);
}

#[test]
fn pictures_that_lie_about_their_sizes_are_refused_at_once() {
    let path = testdata("hostile/claim.png");
    assert_eq!(
        refusal(&path, read_label_png),
        "FILE: the header claims 60000x60000 pixels, but the file has only 69 bytes: write the label image again"
    );
    let folder = tempfile::tempdir().unwrap();
    fs::copy(&path, folder.path().join("photo.png")).unwrap();
    let masks = LabelFolder::open(folder.path()).unwrap();
    let message = refusal(&path, |_| masks.labels_for("photo.jpg", 4000, 3000));
    assert!(
        message.contains("are 60000x60000 px, but its camera is 4000x3000 px"),
        "{message}"
    );
    assert!(refusal(&path, read_rgb).starts_with("FILE: cannot read the image: "));
    assert!(refusal(&testdata("hostile/lie.jpg"), read_rgb).starts_with("FILE: cannot read the image: "));
}

#[test]
fn a_label_image_of_another_size_is_refused_before_it_is_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photo.png");
    let labels = stonewise_core::raster::Raster::filled(400, 300, 7u32);
    stonewise_io::masks::write_label_png(&path, &labels).unwrap();
    let whole = fs::read(&path).unwrap();
    // The pixels are gone; the size is still there.
    fs::write(&path, &whole[..60]).unwrap();
    let masks = LabelFolder::open(folder.path()).unwrap();
    let message = refusal(&path, |_| masks.labels_for("photo.jpg", 4000, 3000));
    assert!(
        message.contains("are 400x300 px, but its camera is 4000x3000 px"),
        "{message}"
    );
}

#[test]
fn camera_files_that_grow_without_bound_are_refused_at_once() {
    for name in ["hostile/bomb.xml", "hostile/xxe.xml"] {
        let message = refusal(&testdata(name), read_cameras);
        assert!(message.contains("broken xml"), "{message}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deep.xml");
    fs::write(&path, "<document>".repeat(100_000)).unwrap();
    let message = refusal(&path, read_cameras);
    assert!(message.contains("is the file complete?"), "{message}");
    let cameras = fs::read_to_string(testdata("cameras/metashape.xml")).unwrap();
    let [depth, begin, end] = [
        300_000,
        cameras.find("<camera ").unwrap(),
        cameras.find("</cameras>").unwrap(),
    ];
    let [open, close] = ["<group>", "</group>"].map(|tag| tag.repeat(depth));
    fs::write(
        &path,
        [
            &cameras[..begin],
            &open,
            &cameras[begin..end],
            &close,
            &cameras[end..],
        ]
        .concat(),
    )
    .unwrap();
    let poses = |path: &Path| {
        let views = read_cameras(path).unwrap().views;
        views
            .into_iter()
            .map(|view| (view.name, view.cam_from_world))
            .collect::<Vec<_>>()
    };
    assert_eq!(poses(&path), poses(&testdata("cameras/metashape.xml")));
    let json = folder.path().join("deep.json");
    fs::write(&json, "[".repeat(300_000)).unwrap();
    assert!(refusal(&json, read_cameras).contains("not an OpenSfM reconstruction"));
    assert_eq!(Crs::parse(&"A[".repeat(300_000)), None);
}

#[test]
fn cameras_of_impossible_size_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("cameras.txt"),
        "1 SIMPLE_PINHOLE 60000 60000 3000 2000 1500\n",
    )
    .unwrap();
    fs::write(folder.path().join("images.txt"), "1 1 0 0 0 0 0 0 1 one.jpg\n\n").unwrap();
    let message = refusal(folder.path(), read_cameras);
    assert!(
        message.contains("60000x60000 pixels, more than any photo, at photo one.jpg"),
        "{message}"
    );
}

fn points(path: &Path) -> Vec<Point3<f64>> {
    let mut all = Vec::new();
    read_cloud(path, 50, |chunk| {
        all.extend(&chunk.positions);
        Ok::<(), CloudError>(())
    })
    .unwrap();
    all
}

fn number(bytes: &[u8], place: usize) -> usize {
    u32::from_le_bytes([bytes[place], bytes[place + 1], bytes[place + 2], bytes[place + 3]]) as usize
}

#[test]
fn compressed_clouds_without_a_table_of_chunks_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    for name in ["clouds/las12_format2.laz", "clouds/las14_format7_extra.laz"] {
        let expected = points(&testdata(name));
        let mut bytes = fs::read(testdata(name)).unwrap();
        let start = number(&bytes, 96);
        let table = number(&bytes, start);
        bytes.truncate(table);
        fs::write(&path, &bytes).unwrap();
        assert_eq!(points(&path), expected, "{name}, table cut off");
        bytes[start..start + 8].copy_from_slice(&(-1i64).to_le_bytes());
        fs::write(&path, &bytes).unwrap();
        assert_eq!(points(&path), expected, "{name}, no table written");
        // Without a table the end of the points is still missed.
        bytes.truncate(table - 40);
        fs::write(&path, &bytes).unwrap();
        assert!(refusal(&path, measure_cloud).contains("is cut off"), "{name}");
    }
}

#[test]
fn a_table_of_chunks_is_not_read_for_a_cloud_without_points() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    let mut bytes = fs::read(testdata("clouds/las12_format2.laz")).unwrap();
    // No points, and a table that claims four billion chunks: 64 GB of entries.
    bytes[107..111].fill(0);
    let table = number(&bytes, number(&bytes, 96));
    bytes[table + 4..table + 8].fill(255);
    fs::write(&path, &bytes).unwrap();
    assert!(points(&path).is_empty());
}

#[test]
fn sizes_of_compressed_items_that_overflow_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    let mut bytes = fs::read(testdata("clouds/las12_format2.laz")).unwrap();
    let record = bytes.windows(9).position(|w| w == b"laszip en").unwrap() - 2;
    // Size of the second item: behind the record's head, the description, and the first item.
    let size = record + 54 + 34 + 6 + 2;
    bytes[size..size + 2].fill(255);
    fs::write(&path, &bytes).unwrap();
    assert!(refusal(&path, measure_cloud).contains("does not fit the point format"));
}

#[test]
fn compressed_clouds_with_chunks_of_gigabytes_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    for name in ["clouds/las12_format2.laz", "clouds/las14_format7_extra.laz"] {
        let mut bytes = fs::read(testdata(name)).unwrap();
        let user = b"laszip encoded";
        let record = bytes.windows(user.len()).position(|w| w == user).unwrap() - 2;
        // Behind compressor, coder, version and options.
        let chunk_size = record + 54 + 12;
        bytes[chunk_size..chunk_size + 4].copy_from_slice(&0x7fff_ffffu32.to_le_bytes());
        fs::write(&path, &bytes).unwrap();
        assert_eq!(points(&path), points(&testdata(name)), "{name}");
    }
}

#[test]
fn a_false_number_of_records_does_not_hide_the_points() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    for name in [
        "clouds/las12_format2.laz",
        "clouds/las14_format7_extra.laz",
        "clouds/las14_format8.las",
    ] {
        let expected = points(&testdata(name));
        let sound = fs::read(testdata(name)).unwrap();
        for count in [0u32, 1000, u32::MAX] {
            let mut bytes = sound.clone();
            bytes[100..104].copy_from_slice(&count.to_le_bytes());
            fs::write(&path, &bytes).unwrap();
            assert_eq!(points(&path), expected, "{name}, {count} records");
        }
    }
}

#[test]
fn a_ply_file_may_have_spaces_after_its_first_word() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let sound = fs::read(testdata("clouds/little.ply")).unwrap();
    let mut bytes = b"ply ".to_vec();
    bytes.extend(&sound[3..]);
    fs::write(&path, &bytes).unwrap();
    assert_eq!(points(&path), points(&testdata("clouds/little.ply")));
}

#[test]
fn long_parts_without_points_can_be_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let header = "ply\nformat ascii 1.0\nelement note 1000\nproperty uchar a\nelement vertex 1\nproperty float x\n\
                  property float y\nproperty float z\nend_header\n";
    fs::write(&path, format!("{header}{}1 2 3\n", "7\n".repeat(1000))).unwrap();
    let mut visits = 0;
    let stopped = read_cloud(&path, 10, |chunk| {
        assert!(chunk.is_empty());
        visits += 1;
        if visits == 3 {
            Err(CloudError::UnknownFormat(path.clone()))
        } else {
            Ok(())
        }
    });
    assert!(matches!(stopped, Err(CloudError::UnknownFormat(_))));
    assert_eq!(visits, 3);
}
