//! Settings declared once: a struct with its table of keys and its default, and enums that are words in files.

use std::path::PathBuf;

use serde::de::DeserializeOwned;

use super::key::{Key, Range};

/// A struct of settings, as [`keys!`](crate::keys) declares one.
pub trait Settings: DeserializeOwned + Default {
    /// What there is to know of its keys, in order.
    const KEYS: &'static [Key];
}

/// A type whose values need no range of their own: switches, texts and words.
pub trait Setting {
    /// What a key of this type may be.
    const RANGE: Range;
}

impl Setting for bool {
    const RANGE: Range = Range::Switch;
}

impl Setting for String {
    const RANGE: Range = Range::Text;
}

impl Setting for PathBuf {
    const RANGE: Range = Range::Text;
}

impl<T> Setting for Vec<T> {
    const RANGE: Range = Range::Text;
}

impl<T: Setting> Setting for Option<T> {
    const RANGE: Range = T::RANGE;
}

/// The first paragraph of a doc comment without its full stop, which is a key's help.
pub const fn help(doc: &'static str) -> &'static str {
    let bytes = doc.as_bytes();
    let mut end = 0;
    while end < bytes.len() && bytes[end] != b'\n' {
        end += 1;
    }
    let text = doc.split_at(end).0.trim_ascii();
    match text.as_bytes() {
        [.., b'.'] => text.split_at(text.len() - 1).0,
        _ => text,
    }
}

/// A struct of settings, each with all that there is to know of its key.
///
/// ```text
/// /// What of it can be told, for people.
/// name: Type ["unit"] = default, in range, usually (least, most), from "where the default comes from";
/// ```
///
/// The first paragraph of a field's doc comment is the key's help. The unit is left out where there is none, the range where the
/// type is a [`Setting`], what is usual where no unit could be mistaken, and the source where the default is chosen. The struct reads and writes itself by serde, and keys that a file
/// leaves out have their default; it is [`Settings`](crate::settings::Settings), and its fields are as visible as itself. What stands in `.. { }` at the end are fields that are no keys.
#[macro_export]
macro_rules! keys {
    (
        $(#[$of:meta])*
        $vis:vis struct $name:ident {
            $(
                $(#[$($attribute:tt)*])*
                $key:ident: $type:ty $([$unit:literal])? = $default:expr
                    $(, in $range:expr)? $(, usually $usual:expr)? $(, from $source:expr)?;
            )*
            $(
                .. {
                    $($(#[$with:meta])* $field:ident: $kind:ty = $value:expr;)*
                }
            )?
        }
    ) => {
        $(#[$of])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        $vis struct $name {
            $(
                $(#[$($attribute)*])*
                $(#[doc = concat!("\n\nIn ", $unit, ".")])?
                $vis $key: $type,
            )*
            $($($(#[$with])* $vis $field: $kind,)*)?
        }

        impl $crate::settings::Settings for $name {
            const KEYS: &'static [$crate::settings::Key] = &[
                $($crate::settings::Key {
                    name: stringify!($key),
                    what: $crate::settings::help(concat!($($crate::keys!(@doc $($attribute)*)),*)),
                    unit: concat!($($unit)?),
                    range: $crate::keys!(@range $type $(, $range)?),
                    usual: $crate::keys!(@usual $($usual)?),
                    source: $crate::keys!(@source $($source)?),
                },)*
            ];
        }

        impl Default for $name {
            fn default() -> Self {
                $name {
                    $($key: $default,)*
                    $($($field: $value,)*)?
                }
            }
        }
    };
    (@doc doc = r"") => { "\n" }; // A doc comment of an empty line.
    (@doc doc = $text:literal) => { $text };
    (@doc $($other:tt)*) => { "" };
    (@range $type:ty) => { <$type as $crate::settings::Setting>::RANGE };
    (@range $type:ty, $range:expr) => { $range };
    (@usual) => { None };
    (@usual $usual:expr) => { Some($usual) };
    (@source) => { "chosen" };
    (@source $source:expr) => { $source };
}

/// An enum whose variants are words in files and tables, each written once.
///
/// ```text
/// /// What it is.
/// Variant = "word",
/// ```
///
/// It reads and writes itself as its word by serde, and gets `ALL`, `NAMES` and `name`. A key of this type takes its words.
#[macro_export]
macro_rules! words {
    (
        $(#[$of:meta])*
        $vis:vis enum $name:ident {
            $($(#[$each:meta])* $variant:ident = $word:literal,)+
        }
    ) => {
        $(#[$of])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        $vis enum $name {
            $($(#[$each])* #[serde(rename = $word)] $variant,)+
        }

        #[allow(dead_code)]
        impl $name {
            /// The words, in the order of [`Self::ALL`].
            $vis const NAMES: &'static [&'static str] = &[$($word),+];

            /// Every variant, in order.
            $vis const ALL: [$name; $name::NAMES.len()] = [$($name::$variant),+];

            /// Its word.
            $vis const fn name(self) -> &'static str {
                $name::NAMES[self as usize]
            }
        }

        impl $crate::settings::Setting for $name {
            const RANGE: $crate::settings::Range = $crate::settings::Range::OneOf($name::NAMES);
        }
    };
}

#[cfg(test)]
mod tests {
    use toml::Table;

    use crate::settings::{Key, Range, Settings};

    words! {
        /// Ways to go.
        #[derive(Default)]
        enum Way {
            /// There.
            #[default]
            There = "there",
            /// Back.
            BackAgain = "back_again",
        }
    }

    keys! {
        /// A walk.
        struct Walk {
            /// How far it goes; as long
            /// as there is light.
            ///
            /// What it costs is not told.
            length_m: f64 ["m"] = 100.0, in Range::Within(0.0, 1e4), usually (1.0, 1e3), from "a map";
            /// Where to
            way: Way = Way::There;
            /// Rests, if any.
            #[serde(skip_serializing_if = "Option::is_none")]
            rests: Option<u32> = None, in Range::Within(1.0, 9.0);
            .. {
                /// Whoever goes.
                #[serde(skip)]
                who: String = "me".into();
            }
        }
    }

    #[test]
    fn a_declaration_is_struct_table_and_default() {
        let told = |key: &Key| {
            let Key {
                name,
                what,
                unit,
                range,
                usual,
                source,
            } = key;
            assert_eq!(*usual, (*name == "length_m").then_some((1.0, 1e3)));
            format!("{name}: {what}; {range} {unit}. {source}")
        };
        let table: Vec<String> = Walk::KEYS.iter().map(told).collect();
        assert_eq!(
            table,
            [
                "length_m: How far it goes; as long as there is light; 0 to 10000 m. a map",
                "way: Where to; there, back_again . chosen",
                "rests: Rests, if any; 1 to 9 . chosen",
            ]
        );
        let read: Walk = toml::from_str("way = \"back_again\"\nrests = 2").unwrap();
        let expected = Walk {
            way: Way::BackAgain,
            rests: Some(2),
            ..Walk::default()
        };
        assert_eq!(read, expected);
        assert_eq!((read.length_m, read.who.as_str()), (100.0, "me"));
        let written = Table::try_from(Walk::default()).unwrap().to_string();
        assert_eq!(written, "length_m = 100.0\nway = \"there\"\n");
        assert!(toml::from_str::<Walk>("far = 2").is_err());
        assert_eq!(Way::ALL.map(Way::name), ["there", "back_again"]);
    }
}
