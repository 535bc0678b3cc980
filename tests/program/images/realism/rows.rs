//! The rows and columns of the tables: a row for each noise profile, and differences pair by pair.

use super::*;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// The rows of a CSV file, by column.
pub(super) fn csv(bench: &Bench, file: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(bench.path(file)).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

/// The cells of a column.
pub(super) fn column(rows: &[Vec<String>], name: &str) -> Vec<String> {
    let index = rows[0].iter().position(|head| head == name).unwrap();
    rows[1..].iter().map(|row| row[index].clone()).collect()
}

#[test]
fn intervals_need_three_paired_differences() {
    let bench = Bench::new();
    for (count, name) in ["a", "b", "c"].into_iter().enumerate() {
        pair(&bench, name, count as u32);
        let table = bench.complete(&["realism", "pairs", "--out", "out"]);
        // The title explains the sign, and stands above all numbers.
        let numbers = table.split_once('\n').unwrap().1;
        assert_eq!(numbers.contains('±'), count == 2, "{table}");
        let summary = json(&bench, &[]);
        let differences = &summary["noise"][0]["differences"];
        let rows = csv(&bench, "out/pairs.csv");
        for number_of in ["psnr", "ssim", "kl"] {
            let difference = &differences[number_of];
            assert_eq!(difference["n"], count + 1);
            assert_eq!(difference["interval"].is_array(), count == 2, "{summary:#}");
            assert_eq!(summary["exposure"][number_of]["interval"].is_array(), count == 2);
            let by_pair = column(&rows, &format!("{number_of}_difference"));
            let filled: Vec<f64> = by_pair.iter().filter_map(|cell| cell.parse().ok()).collect();
            assert_eq!(filled.len(), count + 1, "{by_pair:?}");
            let mean = filled.iter().sum::<f64>() / filled.len() as f64;
            assert!((mean - number(&difference["value"])).abs() < 1e-9);
            let values = [&summary["noise"][0], &summary["exposure"]];
            let [noise, exposure] = values.map(|row| number(&row[number_of]["value"]));
            assert!((noise - exposure - mean).abs() < 1e-9);
        }
        // Noise of its own makes an image less like one with other noise.
        assert!(number(&differences["psnr"]["value"]) < 0.0);
        assert!(number(&differences["kl"]["value"]) < 0.0);
    }
}

/// The interval is that of the differences: it is not made of the intervals of the two rows.
#[test]
fn interval_of_difference_is_students() {
    let bench = Bench::new();
    for (salt, name) in ["a", "b", "c"].into_iter().enumerate() {
        pair(&bench, name, salt as u32);
    }
    bench.complete(&["realism", "pairs", "--out", "out"]);
    let summary = json(&bench, &[]);
    let rows = csv(&bench, "out/pairs.csv");
    let cells = column(&rows, "ssim_difference");
    let values: Vec<f64> = cells.iter().filter_map(|cell| cell.parse().ok()).collect();
    let mean = values.iter().sum::<f64>() / 3.0;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    // t of 2 degrees of freedom.
    let half = 4.302_652_730 * (squares / 2.0 / 3.0).sqrt();
    let interval = &summary["noise"][0]["differences"]["ssim"]["interval"];
    assert!((number(&interval[1]) - number(&interval[0]) - 2.0 * half).abs() < 1e-9);
    assert!(half > 0.0);
}

#[test]
fn every_light_reading_has_a_row() {
    let bench = Bench::new();
    for (salt, name) in ["a", "b", "c"].into_iter().enumerate() {
        pair(&bench, name, salt as u32);
    }
    let all = ["--profile", "all", "--out", "out"];
    let table = bench.complete(&[&["realism", "pairs"], &all[..]].concat());
    let names = ["paper", "eld", "level", "physical"];
    check_rows(names, |name| {
        let row = format!("with sensor noise, {name} ");
        assert!(table.contains(&row), "{table}");
        let alone = json(&bench, &["--profile", name]);
        let together = json(&bench, &["--profile", "all"]);
        let rows = together["noise"].as_array().unwrap();
        let row = rows.iter().find(|row| row["reading"] == name).unwrap();
        assert_eq!(alone["noise"].as_array().unwrap().len(), 1);
        assert_eq!(alone["noise"][0], *row, "a reading does not depend on the others");
        assert_eq!(row["camera"], "given");
    });
    let rows = csv(&bench, "out/pairs.csv");
    assert_eq!(rows.len(), 1 + 3 * 5);
    let readings = column(&rows, "reading");
    assert_eq!(readings[..5], ["", "paper", "eld", "level", "physical"]);
    let by_code = csv(&bench, "out/residuals_by_code.csv");
    assert!(column(&by_code, "reading").contains(&"level".to_owned()));
    let list = json(&bench, &["--profile", "physical,eld"]);
    assert_eq!(list["noise"].as_array().unwrap().len(), 2);
    assert_eq!(list["fits"], serde_json::json!([]));
}
