//! Logs of every kind, good and bad.

use super::*;
use crate::core::random::Rng;
use crate::core::time::{TICKS_PER_SECOND, seconds};
use crate::rigid::testing::{shipped, thinned};

fn read(text: &str) -> Result<ContactTrack, LogError> {
    read_contacts(text.as_bytes(), None, &LogOptions::default())
}

const OWN: &str = "time_ms,a,b,px_mm,py,pz,nx,ny,nz,impulse,vx,vy,vz,fx,fy,fz\n\
    0,world,box,0,0,0,0,0,1,0.05,0.5,0,0,-1,0,0\n\
    10,world,box,5,0,0,0,0,1,0.05,0.5,0,0,-1,0,0\n";
const MUJOCO: &str = "time,body1,body2,name1,name2,px,py,pz,nx,ny,nz,force_normal,force_tangent1,force_tangent2,impulse_normal,impulse_tangent,depth,vel_normal,vel_tangent,vt_x,vt_y,vt_z,vel_normal_in\n\
    0.01,3,0,ball,world,-0.5,0.04,-0.001,0,0,-1,1037.9,-3.5,21.0,0.05,0.01,0.002,-1.15,0.5,-0.5,0,0,-3.07\n";
const BULLET: &str = "step,time,bodyA,bodyB,nameA,nameB,posA_x,posA_y,posA_z,posB_x,posB_y,posB_z,normalOnB_x,normalOnB_y,normalOnB_z,distance,normalForce,friction1,f1_x,f1_y,f1_z,friction2,f2_x,f2_y,f2_z,relvel_n,relvel_t\n\
    3,0.01,1,2,ramp,box,0,0,1,0,0,0,0,0,-1,-0.001,5,1,1,0,0,0,0,1,0,0.2,0.5\n";

#[test]
fn own_columns_in_their_units() {
    let track = read(OWN).unwrap();
    let (tick, frame) = track.frames[1];
    assert_eq!((tick, frame.bodies, frame.contact), (ticks(0.01), [0, 1], 0));
    assert!((frame.force - 5.0).abs() < 1e-5 && (frame.point[0] - 0.005).abs() < 1e-9, "{frame:?}");
    assert_eq!((frame.friction, frame.velocity), (Some([-1.0, 0.0, 0.0]), [0.5, 0.0, 0.0]));
    // The contact moves with the box: at the speed of the slip over the world, at 0 over the box.
    let [Some(over), Some(under)] = frame.travel else { panic!("{frame:?}") };
    assert!((over[0] - 0.5).abs() < 1e-6 && under[0].abs() < 1e-6, "{frame:?}");
}

#[test]
fn bodies_of_mujoco_rows_are_swapped_so_that_body_a_has_the_smaller_number() {
    let frame = read(MUJOCO).unwrap().frames[0].1;
    assert_eq!((frame.bodies, frame.normal), ([0, 3], [0.0, 0.0, 1.0]));
    // The ball approaches: it moves against the normal.
    assert!((frame.velocity[2] + 1.15).abs() < 1e-6 && (frame.velocity[0] - 0.5).abs() < 1e-6, "{frame:?}");
    assert_eq!(frame.approach, Some(3.07));
    assert!((frame.force - 0.05 * 60.0).abs() < 1e-4, "an impulse of one frame of unknown length: {frame:?}");
    // Friction is opposite to the slip.
    assert!(frame.friction.unwrap()[0] < 0.0);
}

#[test]
fn bullet_normals_and_frictions_are_reversed() {
    let frame = read(BULLET).unwrap().frames[0].1;
    assert_eq!((frame.bodies, frame.normal, frame.point), ([1, 2], [0.0, 0.0, 1.0], [0.0, 0.0, 0.5]));
    assert_eq!((frame.friction, frame.force), (Some([-1.0, 0.0, 0.0]), 5.0));
    assert_eq!(frame.velocity, [0.5, 0.0, 0.2], "separating, and slipping against its friction");
}

#[test]
fn json_lines_give_the_same_contacts() {
    let json = "{\"time_s\": 0, \"a\": \"world\", \"b\": \"box\", \"point\": [0,0,0], \"normal\": [0,0,1], \"impulse\": 0.05, \"velocity\": [0.5,0,0], \"friction\": [-1,0,0]}\n\n\
        {\"time_s\": 0.01, \"a\": \"world\", \"b\": \"box\", \"point\": [0.005,0,0], \"normal\": [0,0,1], \"impulse\": 0.05, \"velocity\": [0.5,0,0], \"friction\": [-1,0,0]}\n";
    assert_eq!(read(json).unwrap().frames, read(OWN).unwrap().frames);
    // Lines that `foley live` reads name their channel.
    let sent = json.replace("{\"time_s\"", "{\"contact\": \"ball\", \"time_s\"");
    assert_eq!(read(&sent).unwrap().frames, read(OWN).unwrap().frames);
}

/// Rows of points `(time, x, y, force)` of one pair, at 100 frames per second, that slip at 1 m/s in x.
fn rows(points: &[(f64, f64, f64, f64)]) -> String {
    let header = "time,a,b,px,py,pz,nx,ny,nz,force,vx,vy,vz\n".to_owned();
    points.iter().fold(header, |text, (t, x, y, f)| text + &format!("{t},0,1,{x},{y},0,0,0,1,{f},1,0,0\n"))
}

#[test]
fn points_are_tracked_separately_or_joined() {
    let mut points = Vec::new();
    for k in 0..20 {
        let (t, x) = (0.01 * f64::from(k), 0.01 * f64::from(k));
        // In another order each frame.
        let mut pair = [(t, x, 0.0, 1.0), (t, x, 0.1, 3.0)];
        pair.rotate_left(k as usize % 2);
        points.extend(pair);
    }
    let text = rows(&points);
    let options = LogOptions { manifold: Manifold::Points, ..LogOptions::default() };
    let apart = read_contacts(text.as_bytes(), None, &options).unwrap();
    assert_eq!((apart.contacts, apart.frames.len()), (2, 40));
    let own: Vec<f64> =
        apart.frames.iter().filter(|(_, f)| f.contact == 0).map(|(_, f)| f.point[1]).collect();
    assert!(own.iter().all(|y| *y == own[0]), "{own:?}");
    let joined = read(&text).unwrap();
    assert_eq!((joined.contacts, joined.frames.len()), (1, 20));
    for (k, (_, frame)) in joined.frames.iter().enumerate() {
        assert!((frame.point[1] - 0.075).abs() < 1e-9 && frame.force == 4.0, "{frame:?}");
        assert_eq!((frame.begins, frame.ends), (k == 0, k == 19));
    }
}

#[test]
fn a_face_whose_points_jump_slides_at_constant_speed() {
    // A face 0.2 m wide: each frame has one of its corners.
    let mut rng = Rng::new(5);
    let points: Vec<_> = (0..300)
        .map(|k| {
            let t = 0.01 * f64::from(k);
            (t, t + [-0.1, 0.1][rng.below(2)], [-0.1, 0.1][rng.below(2)], 4.0)
        })
        .collect();
    let track = read(&rows(&points)).unwrap();
    assert_eq!(track.contacts, 1);
    let late = || track.frames.iter().skip(100);
    for (_, frame) in late() {
        let over = frame.travel[0].unwrap();
        assert!((over[0] - 1.0).abs() < 0.05 && over[1].abs() < 0.05, "{frame:?}");
    }
    let steps = late().zip(late().skip(1)).map(|((_, a), (_, b))| (b.point[0] - a.point[0] - 0.01).abs());
    assert!(steps.fold(0.0, f64::max) < 1e-3, "its position changes at a constant rate");
}

#[test]
fn a_rolling_ball_is_tracked_exactly() {
    let header = "time,a,b,px,py,pz,nx,ny,nz,force,vx,vy,vz\n".to_owned();
    let text = (0..50).fold(header, |text, k| {
        let t = 0.01 * f64::from(k);
        text + &format!("{t},0,1,{},0,0,0,0,1,1,0,0,0\n", 0.7 * t)
    });
    let track = read(&text).unwrap();
    for (tick, frame) in track.frames.iter().skip(10) {
        assert!((frame.point[0] - 0.7 * seconds(*tick)).abs() < 1e-6, "{frame:?}");
        for travel in frame.travel {
            assert!((travel.unwrap()[0] - 0.7).abs() < 1e-3, "over both bodies alike: {frame:?}");
        }
    }
}

#[test]
fn short_gaps_are_bridged_and_long_ones_end_the_contact() {
    let times = [0, 1, 2, 4, 5, 9, 10];
    let points: Vec<_> = times.iter().map(|k| (0.01 * f64::from(*k), 0.0, 0.0, 2.0)).collect();
    let track = read(&rows(&points)).unwrap();
    let found: Vec<(i64, u64, f32, bool, bool)> = track
        .frames
        .iter()
        .map(|(t, f)| ((seconds(*t) * 100.0).round() as i64, f.contact, f.force, f.begins, f.ends))
        .collect();
    let expected = [
        (0, 0, 2.0, true, false),
        (1, 0, 2.0, false, false),
        (2, 0, 2.0, false, false),
        (3, 0, 0.0, false, false),
        (4, 0, 2.0, false, false),
        (5, 0, 2.0, false, true),
        (9, 1, 2.0, true, false),
        (10, 1, 2.0, false, true),
    ];
    assert_eq!(found, expected);
    assert_eq!((track.bridged, track.contacts), (1, 2));
}

#[test]
fn faces_of_one_pair_with_different_normals_are_separate_contacts() {
    let text = "time,a,b,px,py,pz,nx,ny,nz,force,vx,vy,vz\n\
        0,0,1,0,0,0,0,0,1,1,0,0,0\n0,0,1,0.01,0,0.001,-0.7,0,0.7,1,0,0,0\n";
    assert_eq!(read(text).unwrap().contacts, 2);
}

#[test]
fn poses_give_positions_on_bodies_velocities_and_approach() {
    let text = "time,a,b,px,py,pz,nx,ny,nz,force\n0.1,0,1,1,0,0,0,0,1,1\n0.11,0,1,1,0,0,0,0,1,1\n";
    let poses = "time,body,px,py,pz,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n\
        0,1,1,0,0.5,1,0,0,0,0.3,0,-2,0,0,0\n0.0999,1,1,0,0.5,1,0,0,0,0.3,0,-2,0,0,0\n0.1,1,1,0,0.5,1,0,0,0,0.3,0,1,0,0.6,0\n";
    let options = LogOptions { masses: vec![0.0, 0.4], ..LogOptions::default() };
    let track = read_contacts(text.as_bytes(), Some(poses.as_bytes()), &options).unwrap();
    let frame = track.frames[0].1;
    assert_eq!(frame.local, [[1.0, 0.0, 0.0], [0.0, 0.0, -0.5]]);
    assert!(frame.velocity[0].abs() < 1e-6, "it rolls: {frame:?}");
    assert_eq!((frame.approach, frame.mass), (Some(2.0), Some(0.4)));
}

const POSES: &str = "time,body,px,py,pz,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n";
const FORCES: &str = "time,a,b,px,py,pz,nx,ny,nz,force\n";

#[test]
fn a_bounce_has_the_speed_and_the_time_of_its_contact_at_any_rate() {
    // A ball that spins falls on the ground at 0.412 s and rebounds.
    let (radius, contact, fall, rebound, along, spin) = (0.1, 0.412, 3.0, 1.8, 4.0, 60.0);
    // The log has the point at the end of the frame, or that of the contact.
    for (rate, is_late) in [(60.0, true), (60.0, false), (240.0, true), (240.0, false)] {
        let (mut poses, mut rows) = (POSES.to_owned(), FORCES.to_owned());
        for k in 0..(0.6 * rate) as u32 {
            let t = f64::from(k) / rate;
            let since = t - contact;
            let [z, v] = if since < 0.0 {
                [-fall * since - 4.905 * since * since, -fall - 9.81 * since]
            } else {
                [rebound * since - 4.905 * since * since, rebound - 9.81 * since]
            };
            let spin = if since < 0.0 { spin } else { 0.3 * spin };
            poses += &format!("{t},1,{},0,{},1,0,0,0,{along},0,{v},0,{spin},0\n", along * t, z + radius);
            if (0.0..1.0 / rate).contains(&since) {
                // The mean force of the frame, without gravity.
                let force = 0.4 * (fall + rebound) * rate;
                rows += &format!("{t},0,1,{},0,0,0,0,1,{force}\n", along * if is_late { t } else { contact });
            }
        }
        let options = LogOptions { masses: vec![0.0, 0.4], rate: Some(rate), ..LogOptions::default() };
        let track = read_contacts(rows.as_bytes(), Some(poses.as_bytes()), &options).unwrap();
        let (tick, frame) = track.frames[0];
        let approach = f64::from(frame.approach.unwrap());
        assert!((approach / fall - 1.0).abs() < 0.01, "{rate}: {approach}");
        let begin = seconds(tick) - f64::from(frame.depth.unwrap()) / approach;
        assert!((begin - contact).abs() < 2e-4, "{rate}: {begin}");
    }
}

#[test]
fn an_edge_that_lands_while_another_one_rests_has_the_time_of_its_landing() {
    // A plate turns about its left edge, and its right edge rebounds.
    let (half, landing, fall, rebound) = (0.1, 0.312, 2.0, 0.5);
    for rate in [60.0, 240.0] {
        let (mut poses, mut rows) = (POSES.to_owned(), FORCES.replace("force", "force,approach"));
        for k in 0..(0.6 * rate) as u32 {
            let t = f64::from(k) / rate;
            let since = t - landing;
            let [tilt, turn] = if since < 0.0 { [-fall * since, -fall] } else { [rebound * since, rebound] };
            let (s, c) = tilt.sin_cos();
            let ([x, z], [vx, vz]) = ([half * (c - 1.0), half * s], [-half * s * turn, half * c * turn]);
            let (qw, qy) = ((0.5 * tilt).cos(), -(0.5 * tilt).sin());
            poses += &format!("{t},1,{x},0,{z},{qw},0,{qy},0,{vx},0,{vz},0,{},0\n", -turn);
            rows += &format!("{t},0,1,{},0,0,0,0,1,2,0\n", -half);
            if (0.0..1.0 / rate).contains(&since) {
                rows += &format!("{t},0,1,{half},0,0,0,0,1,30,{}\n", 2.0 * half * fall);
            }
        }
        let options = LogOptions { masses: vec![0.0, 0.4], rate: Some(rate), ..LogOptions::default() };
        let track = read_contacts(rows.as_bytes(), Some(poses.as_bytes()), &options).unwrap();
        let landed: Vec<_> = track.frames.iter().filter(|(_, frame)| frame.depth.is_some()).collect();
        let [(tick, frame)] = landed[..] else { panic!("{rate}: {landed:?}") };
        let at = seconds(*tick) - f64::from(frame.depth.unwrap() / frame.approach.unwrap());
        assert!((at - landing).abs() < 3e-4 && !frame.begins, "{rate}: {at}");
    }
}

#[test]
fn a_corner_that_is_pressed_in_at_the_end_of_the_frame_has_the_time_of_its_landing() {
    // A mass on a spring from its landing on, in contact with another corner before.
    let (speed, frequency, frame_end) = (1.4, 60.0, 0.4);
    let omega = std::f64::consts::TAU * frequency;
    for rate in [60.0, 240.0] {
        for phase in [0.2, 0.7, 1.2, 1.4] {
            let landing = frame_end - phase / omega;
            let (mut poses, mut rows) = (POSES.to_owned(), FORCES.replace("force", "force,approach,depth"));
            for k in 0..(0.6 * rate) as u32 {
                let t = f64::from(k) / rate;
                let angle = omega * (t - landing);
                let [z, v] = match angle {
                    ..=0.0 => [-speed * (t - landing), -speed],
                    _ => [-speed / omega * angle.sin(), -speed * angle.cos()],
                };
                poses += &format!("{t},1,0,0,{z},1,0,0,0,0,0,{v},0,0,0\n");
                if (t - frame_end).abs() < 1e-9 {
                    rows += &format!("{t},0,1,0.1,0,0,0,0,1,300,{speed},{}\n", -z);
                } else if t < frame_end && t > 0.2 {
                    rows += &format!("{t},0,1,0,0,0,0,0,1,2,0,0.0001\n");
                }
            }
            let options = LogOptions { masses: vec![0.0, 0.4], rate: Some(rate), ..LogOptions::default() };
            let track = read_contacts(rows.as_bytes(), Some(poses.as_bytes()), &options).unwrap();
            let (tick, frame) = track.frames.last().unwrap();
            let at = seconds(*tick) - f64::from(frame.depth.unwrap() / frame.approach.unwrap());
            assert!((at - landing).abs() < 1e-5 && !frame.begins, "{rate}, {phase}: {at} {landing}");
        }
    }
}

#[test]
fn a_ball_that_rolls_never_approaches() {
    let (mut poses, mut rows) = (POSES.to_owned(), FORCES.to_owned());
    for k in 0..60 {
        let t = f64::from(k) / 60.0;
        poses += &format!("{t},1,{},0,0.1,1,0,0,0,3,0,0,0,30,0\n", 3.0 * t);
        rows += &format!("{t},0,1,{},0,0,0,0,1,4\n", 3.0 * t);
    }
    let options = LogOptions { masses: vec![0.0, 0.4], ..LogOptions::default() };
    let track = read_contacts(rows.as_bytes(), Some(poses.as_bytes()), &options).unwrap();
    assert!(track.frames.iter().all(|(_, frame)| frame.approach.is_some_and(|v| v < 1e-3)));
}

#[test]
fn a_byte_order_mark_is_skipped() {
    let json = r#"{"time_s": 0.1, "a": "w", "b": "x", "point": [0,0,0], "normal": [0,0,1], "force": 1, "velocity": [0,0,0]}"#;
    for text in [OWN, json] {
        let (plain, marked) = (read(text).unwrap(), read(&format!("\u{feff}{text}")).unwrap());
        assert_eq!(plain.frames, marked.frames);
    }
}

#[test]
fn errors_have_line_column_and_the_expected_contents() {
    let head = "time,a,b,px,py,pz,nx,ny,nz,force,vx,vy,vz\n";
    let good = "0,w,x,0,0,0,0,0,1,1,0,0,0\n";
    let with = |rows: &str| format!("{head}{rows}");
    let json = |time: &str| {
        let rest =
            r#""a": "w", "b": "x", "point": [0,0,0], "normal": [0,0,1], "force": 1, "velocity": [0,0,0]}"#;
        format!("{{\"time_s\": {time}, {rest}\n")
    };
    for (text, part) in [
        (String::new(), "line 1: the file is empty"),
        (head.to_owned(), "no contact under the header"),
        (
            with("0,w,x,0,nan,0,0,0,1,1,0,0,0\n"),
            "line 2, column `py`: \"nan\" is there; a finite number is needed",
        ),
        (with("0,w,x,0,0,0,0,0,1,inf,0,0,0\n"), "line 2, column `force`: \"inf\""),
        (with("0,w,x,0,0,0,0,0,1,-1,0,0,0\n"), "column `force`: -1 is there; a number from 0 on"),
        (with("0,w,x,0,0,0,0,0,1,,0,0,0\n"), "line 2: how hard do they press"),
        (with("0,w,x,0,0,0,0,0,9,1,0,0,0\n"), "line 2, column `nx`: the normal has length 9"),
        (with("0,w,x,0,0,0,0,0,1,1,0,0\n"), "line 2: 12 field(s) where the header has 13"),
        (
            with(&format!("{}{good}", good.replace("0,w", "2,w"))),
            "line 3, column `time`: time goes back from 2 to 0 s",
        ),
        (with("0,w,w,0,0,0,0,0,1,1,0,0,0\n"), "touches itself"),
        (with("-1,w,x,0,0,0,0,0,1,1,0,0,0\n"), "line 2, column `time`: -1 s"),
        (with("0,,x,0,0,0,0,0,1,1,0,0,0\n"), "line 2, column `a`: nothing is there"),
        (head.replace("py", "pq"), "line 1, column `pq`: there is no such column; known are time, id"),
        (head.replace("time,", ""), "no column for `time`"),
        (head.replace(",a,", ","), "no column for the two bodies"),
        (head.replace(",px", ""), "no column for where"),
        (head.replace(",nz", ""), "no column for the normal"),
        (head.replace(",force", ""), "no column for how hard"),
        (head.replace(",vy", ""), "no column for the velocity"),
        ("{\"time_s\": 0, \"a\": 0}".into(), "line 1, column `b`: nothing is there; a body's name"),
        ("{\"time_s\": 0, \"loud\": 0}".into(), "line 1, column `loud`: there is no such key"),
        ("{\"time_s\": 0,".into(), "line 1: this is not a JSON object"),
        (json("0").replace("\"force\": 1", "\"force\": NaN"), "line 1: this is not a JSON object"),
        (
            json("0").replace("\"force\": 1", "\"force\": -1"),
            "line 1, column `force`: -1 is there; a number from 0 on",
        ),
        (json("0").replace("[0,0,1]", "[0,0,9]"), "line 1, column `normal`: the normal has length 9"),
        (json("2") + &json("1"), "line 2, column `time_s`: time goes back from 2 to 1 s"),
        ("[{\"time_s\": 0}]".into(), "line 1: a JSON list begins here; one object in each line"),
        (head.replace(',', ";"), "line 1, column `time`: columns are separated by ';'; commas"),
        (
            with("0,w,x,0,0,0,0,0,1,1e30,0,0,0\n"),
            "column `force`: \"1e30\" is there; a number of at most 1e12",
        ),
    ] {
        let e = read(&text).unwrap_err().to_string();
        assert!(e.contains(part), "{text:?}: {e}");
    }
    assert!(read_contacts(&[0xff, 0xfe, 0], None, &LogOptions::default()).is_err());
}

#[test]
fn damaged_logs_give_contacts_or_an_error() {
    let json = "{\"time_s\": 0.01, \"a\": 1, \"b\": \"x\", \"point\": [0,0,0], \"normal\": [0,0,1], \"force\": 5, \"velocity\": [0.5,0,0]}\n";
    let poses = "time,name,px,py,pz,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n0,box,1,0,0.5,1,0,0,0,0.3,0,-2,0,0,0\n0.05,box,1,0,0,1,0,0,0,0,0,0,0,0,0\n";
    let mut rng = Rng::new(131);
    let (mut good, mut bad) = (0, 0);
    for k in 0..4000 {
        let mut files = [[OWN, MUJOCO, BULLET, json][k % 4], poses].map(|text| text.as_bytes().to_vec());
        let bytes = &mut files[rng.below(5) / 4];
        for _ in 0..=rng.below(3) {
            if bytes.is_empty() {
                break;
            }
            let at = rng.below(bytes.len());
            match rng.below(4) {
                0 => bytes.truncate(at),
                1 => bytes[at] = b",\n\"-9e{}#\xff\x00"[rng.below(11)],
                2 => drop(bytes.remove(at)),
                _ => bytes.insert(at, b"0123456789.,-\n"[rng.below(14)]),
            }
        }
        let poses = (rng.below(2) == 0).then_some(files[1].as_slice());
        match read_contacts(&files[0], poses, &LogOptions::default()) {
            Ok(track) => {
                good += 1;
                assert!(track.frames.is_sorted_by_key(|(tick, frame)| (*tick, frame.contact)));
                assert!(track.frames.iter().all(|(_, f)| f.force.is_finite() && f.force >= 0.0));
                assert!(track.frames.iter().all(|(_, f)| f.point.iter().all(|x| x.is_finite())));
            }
            Err(_) => bad += 1,
        }
    }
    assert!(good > 300 && bad > 1000, "{good} read, {bad} refused");
}

#[test]
fn a_log_that_changes_its_rate_is_read_equally() {
    for (scene, from) in [("box_slide_slope", 1.2), ("ball_bounce_roll", 2.0)] {
        let [contacts, poses] = shipped(scene);
        let read = |text: &str| {
            read_contacts(text.as_bytes(), Some(poses.as_bytes()), &LogOptions::default()).unwrap()
        };
        let (original, slower) = (read(&contacts), read(&thinned(&contacts, from)));
        // A box has contacts in every frame; a ball that rolls over rods does not.
        let bridged = |track: &ContactTrack| {
            track.frames.iter().filter(|(t, f)| seconds(*t) > from && f.force == 0.0 && !f.ends).count()
        };
        println!("{scene}: {} and {} frames without force", bridged(&original), bridged(&slower));
        assert!(bridged(&slower) <= bridged(&original), "{scene}");
        let long = slower.frames.iter().filter(|(t, _)| seconds(*t) > from + 0.1);
        let of_two =
            long.clone().filter(|(_, f)| (f.interval - ticks(1.0 / 30.0)).abs() < ticks(1e-4)).count();
        assert!(of_two * 10 >= long.clone().count() * 8, "{scene}: {of_two} of {}", long.count());
    }
    // And from slow to fast.
    let point = |t: f64| (t, t, 0.0, 2.0);
    let slow = (0..30).map(|k| point(0.02 * f64::from(k)));
    let text = rows(&slow.chain((0..60).map(|k| point(0.6 + 0.01 * f64::from(k)))).collect::<Vec<_>>());
    let track = read(&text).unwrap();
    assert_eq!((track.frames.len(), track.bridged, track.contacts, track.uneven.0), (90, 0, 1, 0));
    let steps: Vec<i64> = track.frames.iter().map(|(_, f)| f.interval / ticks(0.0099)).collect();
    assert!(steps[..31].iter().all(|s| *s == 2) && steps[31..].iter().all(|s| *s == 1), "{steps:?}");
}

#[test]
fn shipped_logs_are_read_completely() {
    for (scene, rows) in [("box_slide_slope", 325), ("ball_bounce_roll", 136)] {
        let [contacts, poses] = shipped(scene);
        let track =
            read_contacts(contacts.as_bytes(), Some(poses.as_bytes()), &LogOptions::default()).unwrap();
        assert_eq!((track.rows, contacts.lines().count()), (rows, rows + 1));
        assert!((TICKS_PER_SECOND as f64 / track.step as f64 / 60.0 - 1.0).abs() < 0.01);
    }
}

#[test]
fn real_logs_are_read_completely() {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/contacts"));
    if !folder.is_dir() {
        println!("skipped: {} is not there", folder.display());
        return;
    }
    for (name, step) in [
        ("ball_bounce_roll.contacts_60hz", 60),
        ("box_slide_slope.contacts_240hz", 240),
        ("dominoes.contacts_60hz", 60),
        ("plates_pile_fall.contacts_240hz", 240),
        ("bullet_boxes_tumble.contacts_240hz", 240),
    ] {
        let (scene, _) = name.split_once('.').unwrap();
        let bytes = std::fs::read(folder.join(format!("{name}.csv"))).unwrap();
        let poses = std::fs::read(folder.join(format!("{scene}.poses.csv"))).unwrap();
        let start = std::time::Instant::now();
        let track = read_contacts(&bytes, Some(&poses), &LogOptions::default()).unwrap();
        let rate = TICKS_PER_SECOND as f64 / track.step as f64;
        println!(
            "{name}: {} rows, {} contacts, {} frames, {} bridged, {:.1} MB/s",
            track.rows,
            track.contacts,
            track.frames.len(),
            track.bridged,
            bytes.len() as f64 / 1e6 / start.elapsed().as_secs_f64()
        );
        assert!((rate / f64::from(step) - 1.0).abs() < 0.01, "{name}: {rate} frames a second");
        assert_eq!(bytes.split(|b| *b == b'\n').filter(|l| !l.is_empty()).count(), track.rows + 1);
    }
}
