//! Formulas of a declared problem: parsed once, then evaluated on numbers. Nothing else can be stated in one: no
//! assignment, no loop, no text.
//!
//!     formula = sum [("<" | "<=" | ">" | ">=" | "==" | "!=") sum]
//!     sum     = product {("+" | "-") product}
//!     product = signed {("*" | "/") signed}
//!     signed  = "-" signed | power
//!     power   = atom ["^" signed]
//!     atom    = number | name | function "(" formula {"," formula} ")" | "(" formula ")"
//!
//! A comparison is 1 if it is true and 0 if not. `if(c, a, b)` is a unless c is 0. `min` and `max` have two arguments or
//! more, `abs`, `exp`, `ln` and `sqrt` one. Written here because the kept parsers of formulas have no function of three
//! arguments, or do not say at which column one is wrong.

use std::fmt;

/// Most characters of a formula.
pub const MOST_CHARACTERS: usize = 2_000;
/// Most formulas inside one another.
pub const MOST_DEEP: usize = 64;
/// Names of the functions, which nothing else may have.
pub const FUNCTIONS: [&str; 7] = ["if", "min", "max", "abs", "exp", "ln", "sqrt"];

/// A formula over the names given when it was parsed.
#[derive(Debug, Clone)]
pub struct Formula {
    /// In the order of evaluation, on a stack.
    code: Vec<Instruction>,
}

/// The first fault of a formula, and its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FormulaError {
    /// The character at which it was noticed, from 1.
    pub column: usize,
    /// The rule that is broken there.
    pub rule: String,
}

impl fmt::Display for FormulaError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "column {}: {}", self.column, self.rule)
    }
}

#[derive(Debug, Clone, Copy)]
enum Instruction {
    Number(f64),
    /// The value of a name, by its place.
    Name(usize),
    One(fn(f64) -> f64),
    Two(fn(f64, f64) -> f64),
    If,
}

#[derive(Debug, Clone, PartialEq)]
enum Token<'t> {
    Number(f64),
    Word(&'t str),
    Sign(&'t str),
    End,
}

impl Formula {
    /// Parses a formula over `names`, whose values it is evaluated on in this order.
    ///
    /// # Errors
    /// The first place that breaks the grammar, a name that is unknown, too many characters, or too deep a formula.
    pub fn parse(text: &str, names: &[&str]) -> Result<Formula, FormulaError> {
        let length = text.chars().count();
        if length > MOST_CHARACTERS {
            return Err(FormulaError {
                column: MOST_CHARACTERS + 1,
                rule: format!("has {length} characters, and may have {MOST_CHARACTERS}"),
            });
        }
        let mut parser = Parser { tokens: tokens(text)?, place: 0, names, code: Vec::new(), depth: 0 };
        parser.formula()?;
        match parser.token() {
            Token::End => Ok(Formula { code: parser.code }),
            _ => Err(parser.expected("an operator or the end")),
        }
    }

    /// Returns the value. `values` are those of the names; `stack` is memory. NaN where the formula has no value. Cost:
    /// one operation for each of its signs.
    pub fn value(&self, values: &[f64], stack: &mut Vec<f64>) -> f64 {
        stack.clear();
        let mut top = f64::NAN;
        for instruction in &self.code {
            match *instruction {
                Instruction::Number(number) => stack.push(std::mem::replace(&mut top, number)),
                Instruction::Name(place) => stack.push(std::mem::replace(&mut top, values[place])),
                Instruction::One(function) => top = function(top),
                Instruction::Two(function) => top = function(stack.pop().unwrap_or(f64::NAN), top),
                Instruction::If => {
                    let [yes, condition] = [(); 2].map(|()| stack.pop().unwrap_or(f64::NAN));
                    top = if condition.is_nan() {
                        condition
                    } else if condition != 0.0 {
                        yes
                    } else {
                        top
                    };
                }
            }
        }
        top
    }
}

/// Splits a text into tokens with their columns.
fn tokens(text: &str) -> Result<Vec<(usize, Token<'_>)>, FormulaError> {
    let mut found = Vec::new();
    let (mut rest, mut column) = (text, 1);
    loop {
        let blank = rest.len() - rest.trim_start().len();
        column += rest[..blank].chars().count();
        rest = &rest[blank..];
        let Some(first) = rest.chars().next() else { break };
        let length = length_of_token(rest, first)
            .ok_or_else(|| FormulaError { column, rule: format!("`{first}` has no meaning here") })?;
        let word = &rest[..length];
        let token = if first.is_ascii_digit() || first == '.' {
            let number: f64 =
                word.parse().map_err(|_| FormulaError { column, rule: format!("`{word}` is no number") })?;
            if !number.is_finite() {
                return Err(FormulaError { column, rule: format!("`{word}` is too large a number") });
            }
            Token::Number(number)
        } else if first.is_alphabetic() || first == '_' {
            Token::Word(word)
        } else {
            Token::Sign(word)
        };
        found.push((column, token));
        column += word.chars().count();
        rest = &rest[length..];
    }
    found.push((column, Token::End));
    Ok(found)
}

/// Returns the bytes of the token at the start of `rest`; `None` if there is none.
fn length_of_token(rest: &str, first: char) -> Option<usize> {
    let run = |belongs: &dyn Fn(char) -> bool| rest.find(|letter| !belongs(letter)).unwrap_or(rest.len());
    if first.is_ascii_digit() || first == '.' {
        let digits = run(&|letter| letter.is_ascii_digit() || letter == '.');
        let Some(after) = rest[digits..].strip_prefix(['e', 'E']) else { return Some(digits) };
        let exponent = after.strip_prefix(['+', '-']).unwrap_or(after);
        let more = exponent.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(exponent.len());
        return Some(if more > 0 { rest.len() - exponent.len() + more } else { digits });
    }
    if first.is_alphabetic() || first == '_' {
        return Some(run(&|letter| letter.is_alphanumeric() || letter == '_'));
    }
    ["<=", ">=", "==", "!=", "<", ">", "+", "-", "*", "/", "^", "(", ")", ","]
        .iter()
        .find(|sign| rest.starts_with(**sign))
        .map(|sign| sign.len())
}

struct Parser<'t> {
    tokens: Vec<(usize, Token<'t>)>,
    place: usize,
    names: &'t [&'t str],
    code: Vec<Instruction>,
    depth: usize,
}

impl<'t> Parser<'t> {
    fn token(&self) -> &Token<'t> {
        &self.tokens[self.place].1
    }

    fn error(&self, rule: String) -> FormulaError {
        FormulaError { column: self.tokens[self.place].0, rule }
    }

    fn expected(&self, what: &str) -> FormulaError {
        let found = match self.token() {
            Token::Number(number) => format!("`{number}`"),
            Token::Word(word) | Token::Sign(word) => format!("`{word}`"),
            Token::End => "the end".to_owned(),
        };
        self.error(format!("expected {what}, and found {found}"))
    }

    /// Goes past one of these signs, and returns it.
    fn sign(&mut self, signs: &[&str]) -> Option<&'t str> {
        let Token::Sign(sign) = *self.token() else { return None };
        signs.contains(&sign).then(|| {
            self.place += 1;
            sign
        })
    }

    fn require(&mut self, sign: &str) -> Result<(), FormulaError> {
        self.sign(&[sign]).map(|_| ()).ok_or_else(|| self.expected(&format!("`{sign}`")))
    }

    /// Parses what is inside another formula.
    fn deeper(&mut self, parse: impl Fn(&mut Self) -> Result<(), FormulaError>) -> Result<(), FormulaError> {
        if self.depth == MOST_DEEP {
            return Err(self.error(format!("is more than {MOST_DEEP} formulas deep")));
        }
        self.depth += 1;
        parse(self)?;
        self.depth -= 1;
        Ok(())
    }

    fn formula(&mut self) -> Result<(), FormulaError> {
        self.sum()?;
        let Some(sign) = self.sign(&["<", "<=", ">", ">=", "==", "!="]) else { return Ok(()) };
        self.sum()?;
        self.code.push(Instruction::Two(match sign {
            "<" => |left, right| truth(left, right, left < right),
            "<=" => |left, right| truth(left, right, left <= right),
            ">" => |left, right| truth(left, right, left > right),
            ">=" => |left, right| truth(left, right, left >= right),
            "==" => |left, right| truth(left, right, left == right),
            _ => |left, right| truth(left, right, left != right),
        }));
        Ok(())
    }

    fn sum(&mut self) -> Result<(), FormulaError> {
        self.left_to_right(Self::product, ["+", "-"], [|left, right| left + right, |left, right| left - right])
    }

    fn product(&mut self) -> Result<(), FormulaError> {
        self.left_to_right(Self::signed, ["*", "/"], [|left, right| left * right, |left, right| left / right])
    }

    /// Parses parts with two operators between them, which are applied from the left.
    fn left_to_right(
        &mut self,
        part: fn(&mut Self) -> Result<(), FormulaError>,
        signs: [&str; 2],
        operators: [fn(f64, f64) -> f64; 2],
    ) -> Result<(), FormulaError> {
        part(self)?;
        while let Some(sign) = self.sign(&signs) {
            part(self)?;
            self.code.push(Instruction::Two(operators[usize::from(sign == signs[1])]));
        }
        Ok(())
    }

    fn signed(&mut self) -> Result<(), FormulaError> {
        if self.sign(&["-"]).is_some() {
            self.deeper(Self::signed)?;
            self.code.push(Instruction::One(|value| -value));
            return Ok(());
        }
        self.atom()?;
        if self.sign(&["^"]).is_some() {
            self.deeper(Self::signed)?;
            self.code.push(Instruction::Two(f64::powf));
        }
        Ok(())
    }

    fn atom(&mut self) -> Result<(), FormulaError> {
        match *self.token() {
            Token::Number(number) => {
                self.place += 1;
                self.code.push(Instruction::Number(number));
                Ok(())
            }
            Token::Word(word) if FUNCTIONS.contains(&word) => {
                self.place += 1;
                self.function(word)
            }
            Token::Word(word) => {
                let place = self.names.iter().position(|name| *name == word);
                let place = place.ok_or_else(|| {
                    // Names that may not be used in this formula are empty.
                    let named: Vec<&str> = self.names.iter().copied().filter(|name| !name.is_empty()).collect();
                    self.error(format!("`{word}` is no name of this formula: {}", named.join(", ")))
                })?;
                self.place += 1;
                self.code.push(Instruction::Name(place));
                Ok(())
            }
            Token::Sign("(") => {
                self.place += 1;
                self.deeper(Self::formula)?;
                self.require(")")
            }
            _ => Err(self.expected("a number, a name or `(`")),
        }
    }

    fn function(&mut self, name: &str) -> Result<(), FormulaError> {
        let at = self.place;
        self.require("(")?;
        let mut arguments = 0;
        loop {
            self.deeper(Self::formula)?;
            arguments += 1;
            match name {
                "min" if arguments > 1 => self.code.push(Instruction::Two(least)),
                "max" if arguments > 1 => self.code.push(Instruction::Two(most)),
                _ => {}
            }
            if self.sign(&[","]).is_none() {
                break;
            }
        }
        self.require(")")?;
        let (fits, wanted) = match name {
            "if" => (arguments == 3, "three arguments"),
            "min" | "max" => (arguments > 1, "two arguments or more"),
            _ => (arguments == 1, "one argument"),
        };
        if !fits {
            let column = self.tokens[at].0;
            return Err(FormulaError { column, rule: format!("`{name}` has {wanted}, and {arguments} are given") });
        }
        match name {
            "if" => self.code.push(Instruction::If),
            "abs" => self.code.push(Instruction::One(f64::abs)),
            "exp" => self.code.push(Instruction::One(f64::exp)),
            "ln" => self.code.push(Instruction::One(f64::ln)),
            "sqrt" => self.code.push(Instruction::One(f64::sqrt)),
            _ => {}
        }
        Ok(())
    }
}

/// Returns 1 for true and 0 for false, and no value if one side has none.
fn truth(left: f64, right: f64, holds: bool) -> f64 {
    if left.is_nan() || right.is_nan() { f64::NAN } else { f64::from(holds) }
}

/// Returns the smaller, and no value if one of them has none: the library's `min` would leave it out.
fn least(left: f64, right: f64) -> f64 {
    if left.is_nan() || right.is_nan() { f64::NAN } else { left.min(right) }
}

fn most(left: f64, right: f64) -> f64 {
    if left.is_nan() || right.is_nan() { f64::NAN } else { left.max(right) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 3] = ["stock", "order", "t"];

    fn value(text: &str) -> f64 {
        Formula::parse(text, &NAMES)
            .unwrap_or_else(|fault| panic!("{text}: {fault}"))
            .value(&[4.0, 7.0, 2.0], &mut Vec::new())
    }

    #[test]
    fn operators_bind_as_in_mathematics() {
        for (text, expected) in [
            ("1 + 2*3", 7.0),
            ("-2^2", -4.0),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("8/4/2", 1.0),
            ("8 - 4 - 2", 2.0),
            ("-stock - -order", 3.0),
            ("2*-3", -6.0),
            ("(1 + 2)*3", 9.0),
            ("1.5e2 + .5 + 2.", 152.5),
            ("max(stock + order - 20, 0)", 0.0),
            ("min(3, stock, order, 9)", 3.0),
            ("if(stock < order, 1, ln(0 - 1))", 1.0),
            ("if(stock >= order, ln(0 - 1), sqrt(stock))", 2.0),
            ("(stock == 4) + (stock != 4) + (t <= 2) + (t > 2)", 2.0),
            ("exp(ln(order))*abs(-t)", 14.0),
        ] {
            assert!((value(text) - expected).abs() < 1e-12, "{text}: {}", value(text));
        }
        for text in ["ln(0 - 1)", "0/0", "min(0/0, 1)", "if(0/0, 1, 1)", "0/0 < 1"] {
            assert!(value(text).is_nan(), "{text}");
        }
    }

    #[test]
    fn a_fault_has_its_column() {
        for (text, column, rule) in [
            ("", 1, "expected a number, a name or `(`, and found the end"),
            ("1 +", 4, "found the end"),
            ("stock + demand", 9, "`demand` is no name"),
            ("1 2", 3, "expected an operator or the end, and found `2`"),
            ("(1", 3, "expected `)`"),
            ("1)", 2, "expected an operator or the end"),
            ("min(1)", 4, "`min` has two arguments or more, and 1 are given"),
            ("ln(1, 2)", 3, "`ln` has one argument"),
            ("if(1, 2)", 3, "`if` has three arguments"),
            ("abs 1", 5, "expected `(`"),
            ("1.2.3", 1, "is no number"),
            ("1e999", 1, "is too large a number"),
            ("stock = 1", 7, "`=` has no meaning"),
            ("\u{e9}t\u{e9} + 1 ; 2", 9, "`;` has no meaning"),
            ("1 < 2 < 3", 7, "expected an operator or the end"),
        ] {
            let fault = Formula::parse(text, &NAMES).unwrap_err();
            assert!(fault.column == column && fault.rule.contains(rule), "{text}: {fault}");
        }
        let deep = |depth: usize| format!("{}1{}", "(".repeat(depth), ")".repeat(depth));
        assert_eq!(Formula::parse(&deep(MOST_DEEP), &NAMES).unwrap().value(&[], &mut Vec::new()), 1.0);
        assert_eq!(Formula::parse(&deep(MOST_DEEP + 1), &NAMES).unwrap_err().column, MOST_DEEP + 2);
        assert!(Formula::parse(&"-".repeat(MOST_CHARACTERS), &NAMES).is_err());
        assert_eq!(Formula::parse(&"1+".repeat(MOST_CHARACTERS), &NAMES).unwrap_err().column, MOST_CHARACTERS + 1);
    }
}
