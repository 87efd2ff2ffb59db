//! All kinds of raster beside each other, what maps of numbers need, and files that are refused.

use super::*;
use crate::files::npy::{Element, write_npy};
use proptest::prelude::*;

fn read(bytes: &[u8]) -> Result<Raster, InputError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x");
    std::fs::write(&path, bytes).unwrap();
    Raster::read(&path)
}

fn png_of(
    width: u32,
    height: u32,
    colour: png::ColorType,
    depth: png::BitDepth,
    data: &[u8],
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(data)
        .unwrap();
    bytes
}

fn npy_of<T: Element>(shape: &[usize], values: &[T]) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_npy(&mut bytes, shape, values).unwrap();
    bytes
}

/// Floats under these names.
fn exr_of(width: usize, channels: &[(&str, &[f32])]) -> Vec<u8> {
    use exr::prelude::*;
    let channel =
        |(name, values): &(&str, &[f32])| AnyChannel::new(*name, FlatSamples::F32(values.to_vec()));
    let list: SmallVec<[_; 4]> = channels.iter().map(channel).collect();
    let size = (width, channels[0].1.len() / width);
    let encoding = Encoding {
        compression: Compression::ZIP16,
        ..Encoding::default()
    };
    let layer = Layer::new(
        size,
        LayerAttributes::default(),
        encoding,
        AnyChannels::sort(list),
    );
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .unwrap();
    bytes.into_inner()
}

#[test]
fn all_kinds_hold_the_same_numbers() {
    use png::{BitDepth, ColorType};
    let expected = [[1.0, 2.0, 3.0], [4.0, 5.0, 60000.0]].concat();
    let wide: Vec<u8> = expected
        .iter()
        .flat_map(|&v| (v as u16).to_be_bytes())
        .collect();
    let floats = |v: &f32| v.to_le_bytes();
    let upside_down = [&expected[3..], &expected[..3]].concat();
    let pfm: Vec<u8> = upside_down.iter().flat_map(floats).collect();
    let doubles: Vec<f64> = expected.iter().map(|&v| v.into()).collect();
    let columns: Vec<u16> = [0, 3, 1, 4, 2, 5].map(|at| expected[at] as u16).to_vec();
    let mut in_columns = npy_of(&[2, 3], &columns);
    let order = in_columns.windows(5).position(|w| w == b"False").unwrap();
    in_columns[order..order + 5].copy_from_slice(b"True ");
    for bytes in [
        png_of(3, 2, ColorType::Grayscale, BitDepth::Sixteen, &wide),
        [b"Pf\n3 2\n-1.0\n".to_vec(), pfm].concat(),
        exr_of(3, &[("B", &[0.0; 6]), ("Z", &expected)]),
        exr_of(3, &[("depth", &expected)]),
        npy_of(&[2, 3], &expected),
        npy_of(&[2, 3], &doubles),
        in_columns,
    ] {
        let raster = read(&bytes).unwrap();
        assert_eq!((raster.width, raster.height), (3, 2));
        assert_eq!(raster.values, expected);
        assert_eq!(raster.value(1, 2), 60000.0);
    }
    let colours = png_of(1, 1, ColorType::Rgb, BitDepth::Eight, &[200, 100, 50]);
    let grey = read(&colours).unwrap();
    assert!((grey.values[0] - 124.2).abs() < 0.1 && grey.white == 255.0);
}

/// A layer of 2 x 2 pixels that begins left of the picture's 3 x 3 and above its lowest row.
#[test]
fn an_exr_of_a_part_stands_where_it_belongs_in_the_picture() {
    use exr::prelude::*;
    let values = FlatSamples::F32(vec![1.0, 2.0, 3.0, 4.0]);
    let channels = AnyChannels::sort([AnyChannel::new("Z", values)].into_iter().collect());
    let place = LayerAttributes::default().with_position(Vec2(9, 21));
    let layer = Layer::new((2, 2), place, Encoding::UNCOMPRESSED, channels);
    let window = IntegerBounds::new((10, 20), (3, 3));
    let image = Image::empty(ImageAttributes::new(window)).with_layer(layer);
    let mut bytes = std::io::Cursor::new(Vec::new());
    image
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .unwrap();
    let raster = super::tests::read(&bytes.into_inner()).unwrap();
    assert_eq!((raster.width, raster.height), (3, 3));
    assert_eq!(raster.values, [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
}

#[test]
fn numbers_of_a_map_have_a_unit_and_a_sign() {
    use png::{BitDepth, ColorType};
    let map = |bytes: &[u8], unit| {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        let map = Raster::read_map(file.path(), unit, "the_unit (0.001 for millimetres)");
        map.map_err(|error| error.to_string())
    };
    let wide = png_of(2, 1, ColorType::Grayscale, BitDepth::Sixteen, &[1, 0, 0, 0]);
    let whole = npy_of(&[2, 1], &[256u16, 0]);
    for whole in [&wide, &whole] {
        assert_eq!(map(whole, Some(1.0 / 256.0)).unwrap().values, [1.0, 0.0]);
        let error = map(whole, None).unwrap_err();
        assert!(error.contains("does not say; give the_unit"), "{error}");
    }
    let colours = png_of(1, 1, ColorType::Rgb, BitDepth::Eight, &[200, 100, 50]);
    assert!(map(&colours, Some(1.0)).unwrap_err().contains("in colour"));
    let none = npy_of(&[1, 4], &[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 5.0]);
    assert_eq!(map(&none, None).unwrap().values, [0.0, 0.0, 0.0, 5.0]);
    let below = npy_of(&[2, 2], &[1.0f32, 2.0, 3.0, -1.0]);
    assert!(
        map(&below, None)
            .unwrap_err()
            .contains("has -1 at row 1, column 1")
    );
}

#[test]
fn what_cannot_be_read_is_named_and_nothing_large_is_unpacked() {
    use png::{BitDepth, ColorType};
    let fine = png_of(40, 40, ColorType::Grayscale, BitDepth::Eight, &[7; 1600]);
    // The same header with other sizes; its checksum follows the 13 bytes of IHDR.
    let of_size = |side: u32| {
        let mut bomb = fine.clone();
        bomb[16..24].copy_from_slice(&[side.to_be_bytes(); 2].concat());
        let sum = crc32(&bomb[12..29]);
        bomb[29..33].copy_from_slice(&sum.to_be_bytes());
        bomb
    };
    let header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (99999999, 99999999)}\n";
    let mut huge = b"\x93NUMPY\x01\x00".to_vec();
    huge.extend((header.len() as u16).to_le_bytes());
    huge.extend(header);
    let mut of_truths = npy_of(&[1, 1], &[1u8]);
    let kind = of_truths.windows(3).position(|w| w == b"|u1").unwrap();
    of_truths[kind..kind + 3].copy_from_slice(b"|b1");
    for (bytes, says) in [
        (of_size(100_000), "100000 x 100000 pixels"),
        (of_size(8000), "broken PNG (it ends early)"),
        (fine[..fine.len() / 2].to_vec(), "broken PNG"),
        (b"P5 3 3 255\n123456789".to_vec(), "is not a PNG"),
        (b"PF\n3 2\n-1.0\n".to_vec(), "in colour"),
        (b"Pf\n3 2\n-1.0\n1234".to_vec(), "broken PFM"),
        (
            b"Pf\n8000 8000 1\n1234".to_vec(),
            "broken PFM (it ends early)",
        ),
        (b"Pf\n0 2\n-1.0\n1234".to_vec(), "no pixels"),
        (b"Pf\n3".to_vec(), "broken PFM (it ends early)"),
        (b"Pf\n99999999 99999999 1\n".to_vec(), "99999999 x 99999999"),
        (huge[..40].to_vec(), "broken NumPy file"),
        (huge, "99999999 x 99999999"),
        (npy_of(&[6], &[0f32; 6]), "[6]"),
        (of_truths, "type"),
        (vec![], "is not a PNG"),
        (
            exr_of(2, &[("R", &[0.0; 4]), ("G", &[0.0; 4])]),
            "channels G, R",
        ),
        (exr_of(2, &[("Z", &[0.0; 4])])[..90].to_vec(), "broken EXR"),
    ] {
        let error = read(&bytes).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    assert!(Raster::read(Path::new("/")).is_err());
}

/// The checksum of a PNG chunk.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 }
        })
    })
}

proptest! {
    #[test]
    fn garbage_is_refused_without_a_panic(kind in 0..5, rest in prop::collection::vec(any::<u8>(), 0..300)) {
        let start: &[u8] = match kind {
            0 => &[0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 13, b'I', b'H', b'D', b'R'],
            1 => b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f4', 'fortran_order': ",
            2 => b"Pf\n",
            3 => b"\x76\x2f\x31\x01\x02\0\0\0channels\0chlist\0",
            _ => b"",
        };
        let _ = read(&[start, &rest].concat());
    }
}
