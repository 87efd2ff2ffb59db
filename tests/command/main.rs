//! The `gdtof` command as its users meet it.

#[path = "../shared/command.rs"]
mod command;
mod detectors_are_described_in_files;
mod tools;
#[path = "../shared/yosys.rs"]
mod yosys;

mod a_page_shows_a_frame;
mod a_real_pair_is_matched;
mod command_line_refuses_bad_input;
mod counts_are_ranged_in_the_windows_of_a_frame;
mod delay_files_replay;
mod delay_lines_are_calibrated;
mod designs_are_proposed;
mod drives_are_recorded;
mod engines_are_chosen_from_the_command_line;
mod every_command;
#[cfg(unix)]
mod every_command_leaves_whole_files;
#[cfg(unix)]
mod every_path;
mod files_of_others_are_kept;
mod frames_for_other_tools;
mod golden_vectors_hold;
mod guides_from_the_command_line;
mod heat_reaches_the_chip;
mod histograms_of_any_sensor_are_ranged;
mod kept_inputs_are_read;
mod libraries_in_any_syntax;
mod libraries_make_the_chip;
#[cfg(unix)]
mod long_runs_keep_their_memory;
mod messages_help;
mod mismatch_replays;
#[cfg(unix)]
mod no_file_blocks_a_command;
mod odd_settings_are_noted;
mod one_window_for_all;
mod photons_reach_any_chip;
mod pictures_agree;
mod probes_keep_their_first_hits;
#[cfg(unix)]
mod progress_shows_on_a_terminal;
mod python_knows_every_key;
mod quiet_runs_say_nothing;
mod real_histograms_are_ranged;
#[cfg(unix)]
mod results_are_one_set;
mod run_time_against_error;
#[cfg(unix)]
mod runs_survive_faults;
mod scenes_name_files;
#[cfg(unix)]
mod silicon_replays;
mod starting_points;
mod sweeps_go_on;
mod the_book_lists_every_key;
mod the_book_reads_plainly;
mod the_book_runs;
mod the_command_explains_itself;
mod the_readme_runs;
mod the_same_everywhere;
mod wave_replays_a_cycle;
#[cfg(unix)]
mod what_is_too_much_is_refused_first;
#[cfg(unix)]
mod wrong_files_are_named;
#[cfg(unix)]
mod wrong_words_are_named;
