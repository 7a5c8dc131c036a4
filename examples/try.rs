use gyroceptron::measure::proof::*;
use std::time::Instant;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let stored = gyroceptron::io::load_model(std::path::Path::new(&path)).unwrap();
    let model = stored.model;
    let map = PlaneMap::of_model(&model).unwrap();
    println!("steps {}", map.steps.len());
    let ray = Ray { from: [0.0, 0.0], to: [0.95, 0.0] };
    for k in 1..20 {
        let x = k as f64 * 0.05;
        println!("{x:.2} {}", turns_of_orbit(&map, ray.from, [x, 0.0]));
    }
    for w in std::env::args().skip(2) {
        let omega: RotationNumber = w.parse().unwrap();
        println!("{omega} {} gamma {}", omega.value().centre(), omega.gamma());
        let t = Instant::now();
        let c = match candidates(&map, ray, &omega) {
            Ok(c) => c,
            Err(e) => {
                println!("{e}");
                continue;
            }
        };
        println!(
            "found {:?} modes {} points {} rho_hat {}",
            t.elapsed(),
            c[0].modes.len(),
            c[0].points,
            c[0].rho_hat
        );
        for c in &c[..1] {
            let t = Instant::now();
            println!("rho {} {:?} {:?}", c.rho, c.prove(&map).unwrap(), t.elapsed());
        }
    }
}
