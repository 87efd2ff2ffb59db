//! Prints the book's table of what guides claim and what holds.
use guided_dtof::guide::GuideInput;
use guided_dtof::guide::{claims, options};
use guided_dtof::scene::{GroundTruth, Scene};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let guides: Vec<&str> = args[0].split(' ').collect();
    let seeds: u64 = args[1].parse().unwrap();
    println!("guide,scene,guided,median_error_m,1,2,3");
    for name in guides {
        let guide = options::parse_all(name.split('+'), "guide").unwrap();
        for scene_name in args[2].split(' ') {
            let scene = Scene::named(scene_name).unwrap();
            let k = claims::kept(&*guide, &scene, 64, 64, 0..seeds).unwrap();
            println!(
                "{name:10} {scene_name:7} guided {:.3} n {} err {:.3} | {:.4} {:.4} {:.4} | {:.4}@4",
                k.share_guided(),
                k.estimates(),
                k.median_error_m(),
                k.share_within(1.),
                k.share_within(2.),
                k.share_within(3.),
                k.share_within(4.)
            );
            if args.len() > 3 {
                // by object and edge
                let mut by: std::collections::BTreeMap<(String, bool), Vec<f64>> =
                    Default::default();
                for seed in 0..seeds {
                    let s = scene.at(seed as f64);
                    let truth = GroundTruth::render(&s, 64, 64);
                    let map = guide
                        .estimate(&GuideInput::still(&s, 64, 64, seed))
                        .unwrap();
                    for p in 0..4096 {
                        if let (Some(o), Some((r, sg))) = (truth.object[p], map.estimate_of(p)) {
                            let edge = truth.surfaces[p].len() > 1
                                || truth.surfaces[p][0].ray_share < 0.999;
                            by.entry((s.objects[o].name.clone(), edge))
                                .or_default()
                                .push((r - truth.range_m[p].unwrap()) / sg);
                        }
                    }
                }
                for ((name, edge), mut z) in by {
                    z.sort_by(f64::total_cmp);
                    let w =
                        |k: f64| z.iter().filter(|z| z.abs() <= k).count() as f64 / z.len() as f64;
                    println!(
                        "   {name:24} edge {edge:5} n {:6} median z {:+.2} | {:.3} {:.3} {:.3} out {}",
                        z.len(),
                        z[z.len() / 2],
                        w(1.),
                        w(2.),
                        w(3.),
                        z.iter().filter(|z| z.abs() > 3.).count()
                    );
                }
            }
        }
    }
}
