//! The keys of a scene file: units, ranges, sources.

use crate::settings::{Key, Range, Section};

/// Beyond a million metres the squares in the geometry lose the small lengths.
const FAR_M: f64 = 1e6;

const fn key(
    name: &'static str,
    unit: &'static str,
    range: Range,
    what: &'static str,
    source: &'static str,
) -> Key {
    Key {
        name,
        what,
        unit,
        range,
        source,
    }
}

const CHOSEN: &str = "chosen for the street";
const TABLE_12: &str = "thesis Table 12";
const LENGTH: Range = Range::Above(0.0, FAR_M);
const POSITION: Range = Range::Within(-FAR_M, FAR_M);
const SHARE: Range = Range::Within(0.0, 1.0);

pub(super) const LIDAR: &[Key] = &[
    key(
        "fov_deg",
        "deg",
        Range::Within(0.1, 150.0),
        "Horizontal field of view; the vertical one follows from the sensor's rows and the shape of its macropixels",
        "chosen: 64 columns of 0.25 degrees",
    ),
    key(
        "macropixel_aspect",
        "",
        Range::Within(0.01, 100.0),
        "Height of a macropixel over its width; HSLIDAR's are 54 um over 114 um",
        "chosen: square",
    ),
    key(
        "wavelength_nm",
        "nm",
        Range::Within(100.0, 1e4),
        "Laser wavelength",
        "thesis 3.2, a dip of the solar spectrum",
    ),
    key(
        "pulse_energy_uj",
        "uJ",
        Range::Limited(0.0, 1e6, "lasers of flash lidars stay below 1 J a pulse"),
        "Energy of one laser pulse over the whole field of view",
        CHOSEN,
    ),
    key(
        "pulse_fwhm_ns",
        "ns",
        Range::Within(0.0, 1e6),
        "Full width at half maximum of the Gaussian pulse, jitter included; with a measured pulse that of what jitter adds",
        "thesis 6.4.2",
    ),
    key(
        "pulse",
        "",
        Range::WordOrCurve(&["gaussian"], "time in ns and power"),
        "Laser pulse",
        "thesis 6.4.2",
    ),
    key(
        "beam",
        "",
        Range::WordOrCurve(
            &["uniform", "gaussian"],
            "degrees off the axis and intensity",
        ),
        "Where the laser's energy goes: uniform is as spot says",
        "thesis Eq. 7",
    ),
    key(
        "beam_fwhm_deg",
        "deg",
        Range::Above(0.0, 180.0),
        "Full width at half maximum of a Gaussian beam",
        "chosen: the field of view",
    ),
    key(
        "pde",
        "",
        SHARE,
        "Photon detection efficiency of the SPADs at the laser's wavelength",
        "thesis Table 6",
    ),
    key(
        "pde_curve",
        "",
        Range::WordOrCurve(
            &["flat"],
            "wavelength in nm and efficiency, of which only the shape counts",
        ),
        "Photon detection efficiency over wavelength, for sunlight",
        "thesis Eq. 14",
    ),
    key(
        "pde_spread",
        "",
        Range::Within(0.0, 1.0),
        "Standard deviation of a SPAD's detection efficiency, relative to the mean; window takes some 12 times as long with it",
        "none in the thesis",
    ),
    key(
        "lens_diameter_mm",
        "mm",
        Range::Above(0.0, f64::MAX),
        "Diameter of the lens aperture",
        CHOSEN,
    ),
    key(
        "lens_f_number",
        "",
        Range::Above(0.0, f64::MAX),
        "Focal length over diameter of the lens",
        CHOSEN,
    ),
    key(
        "transmittance",
        "",
        SHARE,
        "Share of the light that lens and filter let through",
        "thesis Eq. 15, where it is left out",
    ),
    key(
        "vignetting",
        "",
        Range::WordOrCurve(
            &["none", "cos4"],
            "degrees off the axis and illumination of the array",
        ),
        "What an evenly bright scene gives a macropixel off the axis",
        "thesis Eq. 12, which has none",
    ),
    key(
        "filter",
        "",
        Range::WordOrCurve(
            &["irradiance", "top_hat", "gaussian", "cosine", "lorentz"],
            "wavelength in nm and transmittance",
        ),
        "Band-pass filter, through which ASTM G173 sunlight comes; irradiance is one that lets solar_irradiance_w_m2 through",
        "thesis 2.3.3",
    ),
    key(
        "filter_centre_nm",
        "nm",
        Range::Within(100.0, 1e4),
        "Centre of a filter that is a shape",
        "the laser",
    ),
    key(
        "filter_fwhm_nm",
        "nm",
        Range::Above(0.0, 1e4),
        "Full width at half maximum of a filter that is a shape",
        "chosen",
    ),
    key(
        "solar_irradiance_w_m2",
        "W/m2",
        Range::Limited(
            0.0,
            1361.0,
            "the sun has no more outside the atmosphere, at all wavelengths together",
        ),
        "Solar irradiance within the filter's band at 100 klux, where filter is irradiance",
        "ASTM G173 global tilt, 935 to 945 nm",
    ),
    key(
        "dark_count_hz",
        "Hz",
        Range::Limited(0.0, 1.6e8, "16 hot SPADs have 10 MHz each"),
        "Dark counts of one macropixel, all its SPADs together",
        "chosen: 1.25 kHz for each of 16 SPADs",
    ),
    key(
        "dark_count_spread",
        "",
        Range::Within(0.0, 5.0),
        "Standard deviation of the natural logarithm of a SPAD's dark count rate, whose mean stays",
        "none in the thesis",
    ),
    key(
        "hot_spad_share",
        "",
        SHARE,
        "Share of SPADs that are hot",
        "none in the thesis",
    ),
    key(
        "hot_spad_hz",
        "Hz",
        Range::Limited(
            0.0,
            1e7,
            "a SPAD that fires more often is to be switched off",
        ),
        "Dark counts of a hot SPAD",
        "chosen",
    ),
    key(
        "spad_seed",
        "",
        Range::Within(0.0, 4_294_967_295.0),
        "Which SPADs are hot, dark or insensitive",
        "chosen",
    ),
    key(
        "spot",
        "",
        Range::OneOf(&["rectangle", "round"]),
        "What the laser lights up: the field of view, or the circle around it",
        "thesis Eq. 7",
    ),
    key(
        "convention",
        "",
        Range::OneOf(&["thesis", "lambertian"]),
        "Constant of the photon budget: Lambertian radiometry, or 1/pi of it, as printed in the thesis",
        "radiometry: a Lambertian surface sends the share sin2(alpha) of its light into a cone",
    ),
];

pub(super) const STEREO: &[Key] = &[
    key(
        "baseline_m",
        "m",
        LENGTH,
        "Distance from the principal (left) to the right camera",
        TABLE_12,
    ),
    key(
        "focal_mm",
        "mm",
        Range::Above(0.0, f64::MAX),
        "Focal length of both lenses",
        TABLE_12,
    ),
    key(
        "pixel_pitch_um",
        "um",
        Range::Above(0.0, f64::MAX),
        "Pixel pitch of both cameras",
        TABLE_12,
    ),
    key(
        "width",
        "px",
        Range::Within(1.0, 16_384.0),
        "Columns of an image",
        TABLE_12,
    ),
    key(
        "height",
        "px",
        Range::Within(1.0, 16_384.0),
        "Rows of an image",
        TABLE_12,
    ),
    key(
        "disparity_sigma_px",
        "px",
        Range::Within(0.0, f64::MAX),
        "Standard deviation of the matched disparity",
        "thesis Fig. 68, where 1/3 px is overlaid",
    ),
    key(
        "subpixel_steps",
        "",
        Range::Within(1.0, 65_536.0),
        "Disparities are multiples of one over this many pixels",
        "chosen: what semi-global matching gives",
    ),
    key(
        "min_disparity_px",
        "px",
        Range::Above(0.0, f64::MAX),
        "Smallest disparity accepted",
        "thesis 5.2.1, an error below 10 % for a whole pixel",
    ),
    key(
        "max_disparity_px",
        "px",
        Range::Above(0.0, f64::MAX),
        "Largest disparity searched",
        "chosen: the disparity at 15 m, where the thesis's rig begins to see",
    ),
    key(
        "position_m",
        "m",
        POSITION,
        "Place of the principal camera, [right, down, forward] of the lidar",
        CHOSEN,
    ),
    key(
        "yaw_error_deg",
        "deg",
        Range::Within(-45.0, 45.0),
        "By how much the right camera has turned outwards since calibration",
        "thesis Fig. 70; none",
    ),
    key(
        "pitch_error_deg",
        "deg",
        Range::Within(-45.0, 45.0),
        "By how much it has turned upwards",
        "none",
    ),
    key(
        "roll_error_deg",
        "deg",
        Range::Within(-45.0, 45.0),
        "By how much it has turned clockwise about its axis",
        "none",
    ),
    key(
        "baseline_error_m",
        "m",
        Range::Within(-10.0, 10.0),
        "By how much it has moved outwards",
        "none",
    ),
    key(
        "focal_error_percent",
        "",
        Range::Within(-50.0, 50.0),
        "By how much its focal length has grown, per cent",
        "none",
    ),
];

pub(super) const LIGHT: &[Key] = &[
    key(
        "illuminance_klux",
        "klux",
        Range::Limited(
            0.0,
            200.0,
            "the sun with bright clouds about it stays below 150 klux",
        ),
        "Illuminance of the scene by the sun",
        CHOSEN,
    ),
    key(
        "sun_elevation_deg",
        "deg",
        Range::Within(-90.0, 90.0),
        "Height of the sun above the horizon, for shadows and slopes; light from everywhere if left out",
        "thesis Eq. 16, where surfaces face the sun",
    ),
    key(
        "sun_azimuth_deg",
        "deg",
        Range::Within(-360.0, 360.0),
        "Where the sun stands, to the right of forward",
        "chosen",
    ),
    key(
        "sky_share",
        "",
        SHARE,
        "Share of the illuminance that comes from the sky, where the sun has a place",
        "chosen: a clear day; 1 is an overcast one",
    ),
    key(
        "sky_reflectivity",
        "",
        Range::Within(0.0, 10.0),
        "What a surface in the sun's light would reflect to be as bright as the sky",
        "chosen: a clear sky in the near infrared; haze is brighter",
    ),
];

pub(super) const MEDIUM: &[Key] = &[
    key(
        "extinction_1_m",
        "1/m",
        Range::Within(0.0, 10.0),
        "Share of light that fog takes away per metre: 3.912 over the visibility",
        "clear air; Koschmieder's law",
    ),
    key(
        "backscatter_1_m_sr",
        "1/m/sr",
        Range::Within(0.0, 10.0),
        "Share of light that fog sends straight back; extinction over 18.8 sr if left out",
        "O'Connor, Illingworth and Hogan 2004, droplets at 905 nm",
    ),
    key(
        "rain_mm_h",
        "mm/h",
        Range::Within(0.0, 500.0),
        "Rain, which weakens light and sends none back",
        "ITU-R P.1814: 1.076 R^0.67 dB/km",
    ),
    key(
        "overlap_m",
        "m",
        LENGTH,
        "Nearest fog that the laser lights up and the macropixels see",
        "chosen: laser and lens stand side by side",
    ),
];

const SPEED: Range = Range::Within(-1e4, 1e4);
const PLACES: Range = Range::Within(-FAR_M, FAR_M);

pub(super) const RIG: &[Key] = &[
    key(
        "velocity_m_s",
        "m/s",
        SPEED,
        "Velocity of lidar and cameras in the world, [right, down, forward] of how they look at time 0",
        "at rest",
    ),
    key(
        "yaw_rate_deg_s",
        "deg/s",
        Range::Within(-3600.0, 3600.0),
        "How fast they turn to the right",
        "at rest",
    ),
    key(
        "waypoints",
        "",
        PLACES,
        "Where they are at what time, straight between: a list of [s, m right, m down, m forward, degrees to the right]",
        "none",
    ),
];

pub(super) const OBJECT: &[Key] = &[
    key(
        "name",
        "",
        Range::Text,
        "Name in complaints and for --set",
        "-",
    ),
    key(
        "kind",
        "",
        Range::OneOf(&[
            "ground", "plane", "box", "sphere", "cylinder", "person", "mesh", "map",
        ]),
        "Shape",
        "-",
    ),
    key(
        "reflectivity",
        "",
        SHARE,
        "Lambertian reflectivity at the laser's wavelength",
        "-",
    ),
    key(
        "grey",
        "",
        SHARE,
        "Lambertian reflectivity that the cameras see; as reflectivity if left out",
        "-",
    ),
    key(
        "retro",
        "",
        Range::Within(1.0, 1e4),
        "How many times more of the laser's light returns than from a Lambertian surface; 1 if left out, traffic signs 300 to 2000",
        "chosen: pi * 100 to 700 cd/lx/m2 of signs' sheeting, over a reflectivity of 1",
    ),
    key(
        "transmittance",
        "",
        SHARE,
        "Share of light that passes straight through: panes; 0 if left out",
        "-",
    ),
    key(
        "mirror",
        "",
        SHARE,
        "Share of light that is thrown back as by a mirror; 0 if left out, clean panes about 0.08",
        "-",
    ),
    key(
        "texture",
        "",
        Range::OneOf(&["checker", "stripes", "noise", "image"]),
        "Pattern of this and a second material; plain if left out",
        "-",
    ),
    key(
        "texture_file",
        "",
        Range::Text,
        "Of an image: PNG, .npy, PFM or EXR, relative to the scene file; white is this material, black the second",
        "-",
    ),
    key(
        "texture_size_m",
        "m",
        LENGTH,
        "Edge of a checker, width of a stripe or image, size of the largest clouds; 0.5 m if left out",
        "-",
    ),
    key(
        "texture_seed",
        "",
        Range::Within(0.0, 4_294_967_295.0),
        "Of noise: equal seeds give equal clouds; 0 if left out",
        "-",
    ),
    key(
        "texture_shift_m",
        "m",
        POSITION,
        "Shift of the pattern along the surface, [right, down]; none if left out",
        "-",
    ),
    key(
        "texture_turn_deg",
        "deg",
        Range::Within(-3600.0, 3600.0),
        "Turn of the pattern on the surface; none if left out",
        "-",
    ),
    key(
        "second_reflectivity",
        "",
        SHARE,
        "Of a texture: the second material's reflectivity at the laser's wavelength; 0 if left out",
        "-",
    ),
    key(
        "second_grey",
        "",
        SHARE,
        "Of a texture: what the cameras see of the second material; as second_reflectivity if left out",
        "-",
    ),
    key(
        "velocity_m_s",
        "m/s",
        SPEED,
        "Velocity in the world, [right, down, forward]; at rest if left out",
        "-",
    ),
    key(
        "waypoints",
        "",
        PLACES,
        "Where it is at what time, straight between: a list of [s, m right, m down, m forward] from its place",
        "-",
    ),
    key(
        "depth_m",
        "m",
        LENGTH,
        "Of a ground: how far it lies below the lidar",
        "-",
    ),
    key(
        "centre_m",
        "m",
        POSITION,
        "Of a plane, box, sphere or cylinder: its middle, of a mesh: its file's origin, of a map: its camera, [right, down, forward] of the lidar",
        "-",
    ),
    key(
        "normal",
        "",
        POSITION,
        "Of a plane: any vector at right angles to it; towards the lidar if left out",
        "-",
    ),
    key(
        "width_m",
        "m",
        LENGTH,
        "Of a plane: extent along its horizontal edge",
        "-",
    ),
    key(
        "height_m",
        "m",
        LENGTH,
        "Of a plane: extent along its other edge; of a cylinder: its length; of a person: 1.72 m if left out",
        "-",
    ),
    key(
        "size_m",
        "m",
        LENGTH,
        "Of a box: extents [right, down, forward] before it is turned",
        "-",
    ),
    key(
        "yaw_deg",
        "deg",
        Range::Within(-360.0, 360.0),
        "Of a box, person, mesh or map: its turn about the vertical axis, the front to the right; none if left out, and a person walks forward",
        "-",
    ),
    key(
        "radius_m",
        "m",
        LENGTH,
        "Of a sphere or cylinder: its radius",
        "-",
    ),
    key(
        "axis",
        "",
        POSITION,
        "Of a cylinder: any vector along it; upright if left out, as poles are",
        "-",
    ),
    key(
        "foot_m",
        "m",
        POSITION,
        "Of a person: where it stands, [right, down, forward] of the lidar",
        "-",
    ),
    key(
        "file",
        "",
        Range::Text,
        "Of a mesh: an OBJ file (x right, y up, z backwards), relative to the scene file",
        "-",
    ),
    key(
        "scale_m",
        "m",
        LENGTH,
        "Of a mesh: the file's unit of length; 1 m if left out",
        "-",
    ),
    key(
        "depth_file",
        "",
        Range::Text,
        "Of a map: depths that a camera has seen (PNG, .npy, PFM or EXR), 0 where nothing is, relative to the scene file",
        "-",
    ),
    key(
        "reflectivity_file",
        "",
        Range::Text,
        "Of a map: reflectivities at the laser's wavelength, white is 1; the object's reflectivity if left out",
        "-",
    ),
    key(
        "grey_file",
        "",
        Range::Text,
        "Of a map: what the cameras see, white is 1; the object's grey if left out",
        "-",
    ),
    key(
        "depth_unit_m",
        "m",
        LENGTH,
        "Of a map: unit of its depths; if left out a millimetre in a PNG, else a metre",
        "-",
    ),
    key(
        "depth_along",
        "",
        Range::OneOf(&["axis", "range"]),
        "Of a map: whether depths are along the camera's axis or distances from it; axis if left out",
        "-",
    ),
    key(
        "focal_px",
        "px",
        Range::Above(0.0, 1e6),
        "Of a map: focal length of its camera",
        "-",
    ),
    key(
        "principal_px",
        "px",
        Range::Within(-1e6, 1e6),
        "Of a map: principal point of its camera, [column, row]; the middle if left out",
        "-",
    ),
];

/// The sections of a scene file.
pub(super) const SECTIONS: &[Section] = &[
    Section {
        name: "lidar",
        what: "Laser, lens and SPADs of the lidar",
        keys: LIDAR,
    },
    Section {
        name: "stereo",
        what: "The camera pair that guides it",
        keys: STEREO,
    },
    Section {
        name: "light",
        what: "Sunlight",
        keys: LIGHT,
    },
    Section {
        name: "medium",
        what: "What is in the air",
        keys: MEDIUM,
    },
    Section {
        name: "rig",
        what: "Motion of lidar and cameras together; the scene is described at time 0",
        keys: RIG,
    },
    Section {
        name: "object",
        what: "What there is to see: as many objects as wanted, none if left out. Metres; x right, y down, z forward; the lidar is at the origin",
        keys: OBJECT,
    },
];
