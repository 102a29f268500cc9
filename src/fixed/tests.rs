use super::*;
use std::format;

fn binary(text: &str, fraction_bits: u32) -> Result<i64, OutOfRange> {
    Decimal::parse(text).map_err(|_| OutOfRange)?.to_binary(fraction_bits)
}

#[test]
fn every_length_is_distinguished_from_its_neighbours() {
    for bits in (-70_000..70_000).chain([i32::MIN, i32::MAX, i32::MAX - 1]) {
        let text = format!("{}", Length(Millimetres::from_bits(bits)));
        assert_eq!(binary(&text, 16), Ok(i64::from(bits)), "{text}");
    }
}

#[test]
fn a_value_is_read_back_from_the_decimals_that_it_is_shown_with() {
    for bits in (-70_000..70_000).chain([i32::MIN, i32::MAX, i32::MAX - 1]) {
        let decimals = decimals_of(Millimetres::from_bits(bits));
        let shown = BinaryFraction { units: bits.into(), fraction_bits: 16, decimals };
        assert_eq!(binary(&format!("{shown}"), 16), Ok(i64::from(bits)), "{shown}");
    }
    for thousandths in -70_000..70_000 {
        let text = format!("{thousandths}e-3");
        let value = Decimal::parse(&text).ok().and_then(|it| it.to_millimetres().ok());
        assert_eq!(value.map(decimals_of), Some(3), "{text}");
    }
}

/// What is beyond counts as zeros, so that no arithmetic overflows.
#[test]
fn digits_behind_the_eighteenth_are_left_out() {
    for (text, same) in [
        ("1000000000000000007", "100000000000000000e1"),
        ("-1000000000000000007.9", "-100000000000000000e1"),
        ("0.1000000000000000007", "0.100000000000000000"),
        ("9999999999999999999", "999999999999999999e1"),
    ] {
        assert_eq!(Decimal::parse(text), Decimal::parse(same), "{text}");
    }
}

#[test]
fn rests_of_periods_are_exact() {
    let mut bits = 0u64;
    for exponent in (1023 - 60..1023 + 60).cycle().take(5000) {
        bits = bits.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let number = f64::from_bits(bits << 63 | exponent << 52 | bits >> 12);
        for (number, period) in [(number, 360.0), (libm::round(number) * 45.0, 90.0)] {
            let expected = number % period;
            assert_eq!(rest_of_periods(number, period).to_bits(), expected.to_bits());
        }
    }
    assert_eq!(rest_of_periods(-720.0, 360.0).to_bits(), (-0.0f64).to_bits());
}

#[test]
fn square_roots_are_exactly_rounded() {
    let mut bits = 1u64;
    for _ in 0..20_000 {
        bits = bits.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
        let number = f64::from_bits(bits & !(1 << 63));
        if number.is_finite() {
            assert_eq!(square_root(number).to_bits(), number.sqrt().to_bits(), "{number:e}");
        }
    }
    let smallest = f64::from_bits(1);
    for number in [0.0, 1.0, 3.0, 4.0, f64::MIN_POSITIVE, smallest, f64::MAX, f64::INFINITY] {
        assert_eq!(square_root(number), number.sqrt(), "{number:e}");
    }
    assert!(square_root(f64::NAN).is_nan());
}

#[test]
fn division_of_128_bits_is_that_of_the_language() {
    let parts = [0, 1, 2, 3, 0xFFFF_FFFF, 1 << 32, 0x1234_5678_9ABC_DEF1, u64::MAX];
    let all =
        || parts.iter().flat_map(|high| parts.map(|low| u128::from(*high) << 64 | u128::from(low)));
    for dividend in all() {
        for divisor in all().filter(|divisor| *divisor > 0) {
            assert_eq!(divide(dividend, divisor), dividend / divisor, "{dividend} {divisor}");
        }
        let signed = dividend as i128;
        assert_eq!(half(signed), signed / 2, "{signed}");
    }
}

#[test]
fn numbers_are_read_exactly() {
    for (text, fraction_bits, units) in [
        ("0", 30, 0),
        ("-0", 0, 0),
        ("1", 0, 1),
        ("1.5", 1, 3),
        ("-1.5", 0, -2),
        (".5", 1, 1),
        ("5.", 0, 5),
        ("+2", 0, 2),
        ("1e3", 0, 1000),
        ("1E-3", 16, 66),
        ("0.1", 30, 107_374_182),
        ("123456789012345678901234567890e-30", 30, 132_560_718),
        ("1e-400", 30, 0),
        ("0e9999", 30, 0),
    ] {
        assert_eq!(binary(text, fraction_bits), Ok(units), "{text}");
    }
}

#[test]
fn truncating_twice_is_truncating_once() {
    for text in ["0.1", "-0.1", "7.3", "-99.999", "1e-9", "3"] {
        let decimal = Decimal::parse(text).unwrap();
        let fine = decimal.to_binary_truncated(30).unwrap();
        for bits in 0..30 {
            let coarse = decimal.to_binary_truncated(bits).unwrap();
            assert_eq!(fine / (1 << (30 - bits)), coarse, "{text}");
        }
    }
    for (text, units) in [("1.99", 7), ("-1.99", -7), ("0.24", 0), ("-3", -12), ("25e-2", 1)] {
        let decimal = Decimal::parse(text);
        assert_eq!(decimal.map(|decimal| decimal.to_binary_truncated(2)), Ok(Ok(units)));
    }
}

#[test]
fn what_is_no_number_is_refused() {
    for text in [
        "", "-", "+", ".", "e5", "1e", "1e+", "1.2.3", "1,5", "--1", "nan", "inf", "0x10",
        "1e99999", "1 ", "½",
    ] {
        assert_eq!(Decimal::parse(text), Err(NotANumber), "{text:?}");
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    assert_eq!(binary("1e40", 0), Err(OutOfRange));
    assert_eq!(binary("1e18", 3), Err(OutOfRange));
    assert_eq!(binary("9e9999", 0), Err(OutOfRange));
    assert_eq!(Decimal::parse("32768").map(Decimal::to_millimetres), Ok(Err(OutOfRange)));
    assert_eq!(Decimal::parse("1.5").map(Decimal::to_whole), Ok(Err(OutOfRange)));
    assert_eq!(Decimal::parse("15e-1").map(Decimal::to_whole), Ok(Err(OutOfRange)));
    assert_eq!(Decimal::parse("150e-1").map(Decimal::to_whole), Ok(Ok(15)));
}

#[test]
fn floats_come_out_exactly_rounded() {
    for text in ["0.1", "-12.75", "3e22", "1e-22", "123456789.125", "0"] {
        let exact: f64 = text.parse().unwrap_or(f64::NAN);
        assert_eq!(Decimal::parse(text).map(Decimal::to_f64), Ok(exact), "{text}");
    }
}

#[test]
fn rounding_is_half_away_from_zero() {
    assert_eq!(
        [3, -3, 5, -5, 2, 1].map(|value| shift_right_rounding(value, 1)),
        [2, -2, 3, -3, 1, 1]
    );
    assert_eq!(shift_right_rounding(i32::MIN, 31), -1);
    assert_eq!(shift_right_rounding(i32::MAX, 40), 0);
    assert_eq!([7, -7, 6, -6].map(|value| divide_rounding(value, 4)), [2, -2, 2, -2]);
}

#[test]
fn fractions_are_written_rounded_and_without_a_negative_zero() {
    let shown = |units, fraction_bits, decimals| {
        format!("{}", BinaryFraction { units, fraction_bits, decimals })
    };
    assert_eq!(shown(5 << 16, 16, 3), "5.000");
    assert_eq!(shown(-1, 16, 3), "0.000");
    assert_eq!(shown(-1, 1, 0), "-1");
    assert_eq!(shown((1 << 30) - 1, 30, 3), "1.000");
}

#[test]
fn a_number_is_written_so_that_it_is_read_again() {
    for text in ["0", "-12", "0.0005", "1.25e3", "-0.1e-9", "123456789012345678"] {
        let number = Decimal::parse(text).unwrap();
        let written = format!("{number}");
        assert_eq!(Decimal::parse(&written), Ok(number), "{text}: {written}");
    }
    assert_eq!(format!("{}", Decimal::parse("0.0005").unwrap()), "5e-4");
}

#[test]
fn coarser_units_are_rounded_half_away_from_zero() {
    for (value, bits, expected) in [
        (7, 0, 7),
        (1, 1, 1),
        (5, 2, 1),
        (6, 2, 2),
        (7, 2, 2),
        (-5, 2, -1),
        (-6, 2, -2),
        (1000, 4, 63),
        (i32::MIN, 31, -1),
        (i32::MAX, 31, 1),
        (i32::MIN, 1, i32::MIN / 2),
        (i32::MAX, 32, 0),
    ] {
        assert_eq!(shift_right_rounding(value, bits), expected, "{value} >> {bits}");
    }
}

#[test]
fn lengths_have_no_more_decimals_than_tell_them_apart() {
    for (length, text) in [(210.0, "210"), (7.3, "7.3"), (-0.25, "-0.25"), (0.001, "0.001")] {
        assert_eq!(format!("{}", Length(Millimetres::from_num(length))), text);
    }
}

#[test]
fn numbers_of_the_camera_have_up_to_six_decimals_and_no_zeros_behind() {
    for (number, text) in [
        (-2.5, "-2.5"),
        (0.000_001, "0.000001"),
        (10.01, "10.01"),
        (1e15, "1000000000000000"),
        (-1e-7, "0"),
    ] {
        assert_eq!(format!("{}", SixDecimals(number)), text);
    }
}

#[test]
fn hundredths_are_the_nearest_and_not_negative() {
    let hundredths = |text: &str| Decimal::parse(text).map(Decimal::to_hundredths);
    assert_eq!(hundredths("28.1"), Ok(Ok(2810)));
    assert_eq!(hundredths("0.006"), Ok(Ok(1)));
    assert_eq!(hundredths("12e3"), Ok(Ok(1_200_000)));
    for refused in ["-1", "-0.001", "21474837"] {
        assert_eq!(hundredths(refused), Ok(Err(OutOfRange)), "{refused}");
    }
}
