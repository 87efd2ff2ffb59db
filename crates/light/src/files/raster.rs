//! Pictures and maps that users give: one number a pixel, from PNG (8 or 16 bit), NumPy (`.npy`), PFM or OpenEXR
//! (one channel).
//!
//! How large a raster is stands in its header, and is held to a limit, and to what a file of its length can unpack to, before anything is
//! unpacked: a PNG of some kilobytes can unpack to gigabytes, and one of some bytes can say so.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

use super::guarded::open_input;
use super::input::skip_mark;
use super::npy::{NpyHead, Number};
use femtogate::InputError;

/// Most pixels of a raster: four times those of a camera of 16 megapixels, 256 MiB as numbers.
const MOST_PIXELS: u64 = 1 << 26;

/// Most bytes that one byte of a file unpacks to: those of deflate, which no other packing here reaches.
const MOST_UNPACKED: u64 = 1032;

/// One number a pixel, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Values as they stand in the file: whole numbers of a PNG, whatever else holds. Length width·height.
    pub values: Vec<f32>,
    /// The value of white: 255 or 65535 for PNG, 1 for others.
    pub white: f32,
}

impl Raster {
    /// Reads a file; what it is stands in its first bytes. Colours of a PNG become the grey of ITU-R BT.601; what is
    /// transparent in it stays what it is beneath.
    ///
    /// # Errors
    /// When it cannot be read, is none of the kinds, is broken, or has more than 2²⁶ pixels.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Ok(Self::read_any(path)?.raster)
    }

    /// Reads a map of lengths or disparities; `unit` is what its numbers count, 1 if left out. There is no value where it has 0, NaN or infinity:
    /// these become 0.
    ///
    /// # Errors
    /// As [`Raster::read`]; a picture in colour; whole numbers without `unit`, which `unit_key` names; a negative number.
    pub fn read_map(path: &Path, unit: Option<f64>, unit_key: &str) -> Result<Self, InputError> {
        let mut raster = Self::read_numbers(path, unit, unit_key)?;
        for value in raster.values.iter_mut().filter(|value| !value.is_finite()) {
            *value = 0.0;
        }
        Ok(raster)
    }

    /// Reads a map whose 0 is a value; where there is none it has NaN or infinity.
    ///
    /// # Errors
    /// As [`Raster::read_map`].
    pub fn read_numbers(
        path: &Path,
        unit: Option<f64>,
        unit_key: &str,
    ) -> Result<Self, InputError> {
        let complain = |message: String| Err(InputError::new(path.display(), message));
        let Contents {
            mut raster,
            is_colour,
            is_whole,
        } = Self::read_any(path)?;
        if is_colour {
            return complain("is a picture in colour and no map; save it with one channel".into());
        }
        if is_whole && unit.is_none() {
            return complain(format!(
                "has whole numbers, whose unit it does not say; give {unit_key}, or save it with floats as .npy, PFM or EXR"
            ));
        }
        raster.white = 1.0;
        for at in 0..raster.values.len() {
            let value = f64::from(raster.values[at]) * unit.unwrap_or(1.0);
            if value < 0.0 && value.is_finite() {
                let (row, col) = (at / raster.width, at % raster.width);
                return complain(format!(
                    "has {value} at row {row}, column {col}; write 0 where there is no value"
                ));
            }
            raster.values[at] = value as f32;
        }
        Ok(raster)
    }

    fn read_any(path: &Path) -> Result<Contents, InputError> {
        let complain = |message: String| InputError::new(path.display(), message);
        let unreadable = |e| InputError::unreadable(path, &e);
        let file = open_input(path)?;
        let about = file.metadata().map_err(unreadable)?;
        // Each kind is known by its length, which a pipe does not tell.
        if !about.is_file() {
            return Err(complain(
                "is a pipe; write its contents to a file first".into(),
            ));
        }
        let length = about.len();
        let mut reader = BufReader::new(file);
        skip_mark(&mut reader).map_err(unreadable)?;
        let first = reader.fill_buf().map_err(unreadable)?;
        let read = match first {
            [0x89, b'P', b'N', b'G', ..] => read_png(reader, length),
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => read_npy(reader),
            [b'P', b'f' | b'F', ..] => read_pfm(reader).map(floats),
            [0x76, 0x2f, 0x31, 0x01, ..] => read_exr(reader, length),
            _ => Err("is not a PNG, .npy, PFM or EXR; convert it to one of them".into()),
        };
        read.map_err(complain)
    }

    /// The value at a pixel, row 0 at the top.
    #[inline]
    pub fn value(&self, row: usize, col: usize) -> f32 {
        self.values[row * self.width + col]
    }
}

/// What stands in a file.
struct Contents {
    raster: Raster,
    is_colour: bool,
    /// Whether its numbers are whole ones, which count units that the file does not name.
    is_whole: bool,
}

fn floats(raster: Raster) -> Contents {
    Contents {
        raster,
        is_colour: false,
        is_whole: false,
    }
}

/// Refuses what is too large to unpack.
fn check_size(width: u64, height: u64) -> Result<(), String> {
    match width.checked_mul(height) {
        Some(0) => Err("has no pixels; give another file".into()),
        Some(pixels) if pixels <= MOST_PIXELS => Ok(()),
        _ => Err(format!(
            "has {width} x {height} pixels, of which at most {MOST_PIXELS} are read; make it smaller"
        )),
    }
}

/// Refuses a header that promises more than `length` bytes of a file unpack to.
fn check_length(what: &str, pixels: u64, pixel_bytes: usize, length: u64) -> Result<(), String> {
    if pixels.saturating_mul(pixel_bytes as u64) > length.saturating_mul(MOST_UNPACKED) {
        return Err(cut_short(what));
    }
    Ok(())
}

/// What readers say of a file that is cut short; of what else is wrong they speak in terms of the format.
const ENDS_EARLY: [&str; 2] = ["unexpected end of file", "failed to fill whole buffer"];

fn broken(what: &str, error: impl std::fmt::Display) -> String {
    if ENDS_EARLY.contains(&error.to_string().as_str()) {
        cut_short(what)
    } else {
        format!("is a broken {what}; save it again")
    }
}

fn cut_short(what: &str) -> String {
    format!("is a broken {what} (it ends early); save it again")
}

fn read_png(reader: BufReader<File>, length: u64) -> Result<Contents, String> {
    let broken = |e: png::DecodingError| broken("PNG", e);
    let mut decoder = png::Decoder::new_with_limits(reader, png::Limits { bytes: 1 << 30 });
    decoder.set_ignore_text_chunk(true);
    decoder.set_transformations(png::Transformations::EXPAND);
    let info = decoder.read_header_info().map_err(broken)?;
    let (width, height) = (info.width, info.height);
    check_size(width.into(), height.into())?;
    let mut reader = decoder.read_info().map_err(broken)?;
    let too_large = || "does not fit into memory; make it smaller".to_owned();
    check_length("PNG", reader.info().raw_bytes() as u64, 1, length)?;
    let mut bytes = vec![0; reader.output_buffer_size().ok_or_else(too_large)?];
    reader.next_frame(&mut bytes).map_err(broken)?;
    let (colour, depth) = reader.output_color_type();
    let (channels, wide) = (colour.samples(), depth == png::BitDepth::Sixteen);
    let sample = |pixel: &[u8], channel: usize| {
        if wide {
            f32::from(u16::from_be_bytes([
                pixel[2 * channel],
                pixel[2 * channel + 1],
            ]))
        } else {
            f32::from(pixel[channel])
        }
    };
    let grey = |pixel: &[u8]| match channels {
        3 | 4 => 0.299 * sample(pixel, 0) + 0.587 * sample(pixel, 1) + 0.114 * sample(pixel, 2),
        _ => sample(pixel, 0),
    };
    let pixel_bytes = channels * if wide { 2 } else { 1 };
    let raster = Raster {
        width: width as usize,
        height: height as usize,
        values: bytes.chunks_exact(pixel_bytes).map(grey).collect(),
        white: if wide { 65_535.0 } else { 255.0 },
    };
    Ok(Contents {
        raster,
        is_colour: channels >= 3,
        is_whole: true,
    })
}

fn read_npy(mut reader: BufReader<File>) -> Result<Contents, String> {
    let head = NpyHead::read(&mut reader).map_err(|e| broken("NumPy file", e))?;
    let [height, width] = head.shape[..] else {
        let shape = head.shape;
        return Err(format!(
            "is an array of shape {shape:?}; give one with two axes, rows and columns"
        ));
    };
    check_size(width as u64, height as u64)?;
    let numbers = head.numbers(&mut reader).ok_or_else(|| {
        let kind = &head.descr;
        format!("has elements of type {kind}; save it as float32, float64 or whole numbers")
    })?;
    let numbers = numbers.map_err(|e| broken("NumPy file", e))?;
    let value = |at: usize| match numbers[at] {
        Number::Whole(value) => value as f32,
        Number::Float(value) => value as f32,
    };
    let place = |at: usize| {
        if head.is_fortran {
            (at % width) * height + at / width
        } else {
            at
        }
    };
    Ok(Contents {
        raster: Raster {
            width,
            height,
            values: (0..width * height).map(place).map(value).collect(),
            white: 1.0,
        },
        is_colour: false,
        is_whole: matches!(numbers.first(), Some(Number::Whole(_))),
    })
}

/// Portable float map: a text header of kind, size and scale, then rows from the bottom; a negative scale says
/// little-endian.
fn read_pfm(mut reader: BufReader<File>) -> Result<Raster, String> {
    let mut words = Vec::new();
    while words.len() < 4 {
        let mut line = Vec::new();
        let read = (&mut reader).take(200).read_until(b'\n', &mut line);
        if read.map_err(|e| broken("PFM", e))? == 0 {
            return Err(cut_short("PFM"));
        }
        let line = String::from_utf8_lossy(&line).into_owned();
        words.extend(line.split_whitespace().map(str::to_owned));
    }
    let number = |word: &str| word.parse::<u64>().map_err(|e| broken("PFM", e));
    let (width, height) = (number(&words[1])?, number(&words[2])?);
    let scale: f32 = words[3].parse().map_err(|e| broken("PFM", e))?;
    if words.len() > 4 || words[0] != "Pf" {
        return Err("is a PFM in colour; save it with one channel, as Pf".into());
    }
    check_size(width, height)?;
    let (width, height) = (width as usize, height as usize);
    let mut bytes = Vec::new();
    let wanted = 4 * width * height;
    let read = reader.take(wanted as u64).read_to_end(&mut bytes);
    if read.map_err(|e| broken("PFM", e))? < wanted {
        return Err(cut_short("PFM"));
    }
    let from_bytes = if scale < 0.0 {
        f32::from_le_bytes
    } else {
        f32::from_be_bytes
    };
    let rows = bytes.chunks_exact(4 * width).rev();
    let values = rows.flat_map(|row| row.as_chunks::<4>().0.iter().map(|b| from_bytes(*b)));
    Ok(Raster {
        width,
        height,
        values: values.collect(),
        white: 1.0,
    })
}

/// The first layer's channel Z, or else V, Y or its only one, in the picture's display window: 0 where the layer has no pixels.
fn read_exr(mut reader: BufReader<File>, length: u64) -> Result<Contents, String> {
    use exr::error::Error;
    use exr::image::FlatSamples;
    use exr::prelude::{MetaData, ReadChannels, ReadLayers, read};
    let told = |e: Error| {
        match e {
        Error::NotSupported(_) => {
            "is an EXR of a kind that is not read; save it in scan lines or tiles, packed as ZIP or PIZ, without deep or subsampled channels".to_owned()
        }
        other => broken("EXR", other),
    }
    };
    let about = MetaData::read_from_buffered(&mut reader, false).map_err(told)?;
    if about.headers.is_empty() {
        return Err("has no layer; save it again".into());
    }
    for layer in &about.headers {
        let (width, height) = (
            layer.layer_size.width() as u64,
            layer.layer_size.height() as u64,
        );
        check_size(width, height)?;
        check_length(
            "EXR",
            width * height,
            layer.channels.bytes_per_pixel,
            length,
        )?;
    }
    reader.rewind().map_err(|e| e.to_string())?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(reader)
        .map_err(told)?;
    let channels = &image.layer_data.channel_data.list;
    let named = |name: &str| channels.iter().find(|channel| channel.name.eq(name));
    let chosen = ["Z", "V", "Y"].into_iter().find_map(named);
    let only = channels.first().filter(|_| channels.len() == 1);
    let Some(channel) = chosen.or(only) else {
        let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
        return Err(format!(
            "has the channels {}; save one of them, as Z or Y",
            names.join(", ")
        ));
    };
    if channel.sampling.0 != 1 || channel.sampling.1 != 1 {
        return Err("has a channel of fewer pixels than the picture; save it in full".into());
    }
    let display = image.attributes.display_window;
    let (width, height) = (display.size.width(), display.size.height());
    check_size(width as u64, height as u64)?;
    let layer = &image.layer_data;
    let from = layer.attributes.layer_position - display.position;
    let mut values = vec![0.0; width * height];
    for (at, value) in channel.sample_data.values_as_f32().enumerate() {
        let place = |from: i32, at: usize, end: usize| {
            let place = usize::try_from(i64::from(from) + at as i64);
            place.ok().filter(|place| *place < end)
        };
        let col = place(from.x(), at % layer.size.width(), width);
        let row = place(from.y(), at / layer.size.width(), height);
        if let Some((row, col)) = row.zip(col) {
            values[row * width + col] = value;
        }
    }
    Ok(Contents {
        raster: Raster {
            width,
            height,
            values,
            white: 1.0,
        },
        is_colour: false,
        is_whole: matches!(channel.sample_data, FlatSamples::U32(_)),
    })
}

#[cfg(test)]
mod tests;
