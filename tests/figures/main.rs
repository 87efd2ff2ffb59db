//! Formulas against references of many digits, and the published figures.

#[path = "../shared/command.rs"]
mod command;

mod depths_keep_their_bounds;
mod detection_probability_meets_references;
mod functions_keep_their_promises;
mod guides_keep_their_claims;
mod precision_meets_references;
mod published_figures_are_met;
mod quotations_stand_in_the_thesis;
mod slanted_surfaces_keep_their_depth;
