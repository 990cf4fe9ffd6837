//! Reads the returns of several assets from a report.
//!
//! The price of an asset may not come in a period, which the report says with null. Its holding then counts as unmoved.
//! Once its price comes, its return covers every period since the last price, and enters wealth in that one. The law
//! learns neither period: no row holds the return of every asset over that period alone.

use std::collections::BTreeMap;

use crate::control::error::FieldError;
use crate::control::request::by_name::by_name;
use crate::service::entries::report::{OF_ONE, Report, between, none_of, reported_log_return};

const RETURNS_ONCE: &str = "must be the only one of log_returns, simple_returns, prices and missing";

/// Values of several assets by name, null if there is none.
type Values = BTreeMap<String, Option<f64>>;

/// Reads the value of an asset, given the name of its field and its index.
type ReadOne<'a> = dyn Fn(&str, usize, f64) -> Result<f64, FieldError> + 'a;

impl Report {
    /// Returns the log-returns of several assets with these names, `None` for an asset whose price did not come and for
    /// all if they are missing. `known` are the last prices reported.
    ///
    /// # Errors
    /// They are not given in exactly one way, one is out of bounds, or an asset is left out.
    pub(in crate::service) fn log_returns(
        &self,
        names: &[String],
        known: &[Option<f64>],
    ) -> Result<Vec<Option<f64>>, FieldError> {
        let of_one = ["log_return", "simple_return", "price", "previous_price", "executed_allocation"];
        let values = [self.log_return, self.simple_return, self.price, self.previous_price, self.executed_allocation];
        none_of(&std::array::from_fn::<_, 5, _>(|index| (of_one[index], values[index].is_some())), OF_ONE)?;
        if self.previous_prices.is_some() && self.prices.is_none() {
            return Err(FieldError::new("previous_prices", "an object", "must be absent unless prices are given"));
        }
        match (&self.log_returns, &self.simple_returns, &self.prices, self.missing) {
            (Some(values), None, None, false) => {
                read("log_returns", values, names, &|field, _, value| self.given_log_return(field, value))
            }
            (None, Some(values), None, false) => {
                read("simple_returns", values, names, &|field, _, value| reported_log_return(field, value))
            }
            (None, None, Some(prices), false) => self.between_all_prices(prices, names, known),
            (None, None, None, true) => Ok(vec![None; names.len()]),
            (None, None, None, false) => {
                let rule = "must be given, or simple_returns, prices or missing instead of it";
                Err(FieldError::new("log_returns", "null", rule))
            }
            (.., true) => Err(FieldError::new("missing", true, RETURNS_ONCE)),
            (Some(_), ..) => Err(FieldError::new("log_returns", "an object", RETURNS_ONCE)),
            (None, ..) => Err(FieldError::new("simple_returns", "an object", RETURNS_ONCE)),
        }
    }

    fn between_all_prices(
        &self,
        prices: &Values,
        names: &[String],
        known: &[Option<f64>],
    ) -> Result<Vec<Option<f64>>, FieldError> {
        let given = self
            .previous_prices
            .as_ref()
            .map(|before| by_name("previous_prices", "asset", before, names))
            .transpose()?;
        if given.is_none() && known.iter().all(Option::is_none) {
            let rule = "must be given with prices if the period before was not reported with prices";
            return Err(FieldError::new("previous_prices", "null", rule));
        }
        read("prices", prices, names, &|field, asset, price| {
            let before = given.as_deref().unwrap_or(known)[asset];
            let named = format!("previous_{field}");
            let before = before.ok_or_else(|| {
                let rule = "must be given with the price: none was reported before";
                FieldError::new(&named, "null", rule)
            })?;
            if before == 0.0 && given.is_none() {
                let rule = "must be null: the asset lost everything in an earlier period, so it has no return";
                return Err(FieldError::new(field, price, rule));
            }
            between(field, price, (&named, before))
        })
    }
}

/// Reads the values of a field by the names of the assets; at least one is not null.
fn read(field: &str, values: &Values, names: &[String], of: &ReadOne<'_>) -> Result<Vec<Option<f64>>, FieldError> {
    let values = by_name(field, "asset", values, names)?;
    if values.iter().all(Option::is_none) {
        return Err(FieldError::new(field, "null for every asset", "must be left out: give missing instead"));
    }
    let one = |(asset, value): (usize, Option<f64>)| {
        value.map(|value| of(&format!("{field}.{}", names[asset]), asset, value)).transpose()
    };
    values.into_iter().enumerate().map(one).collect()
}

impl Report {
    /// Lists the fields of several assets, and whether each is given.
    pub(super) fn of_several(&self) -> [(&'static str, bool); 5] {
        [
            ("log_returns", self.log_returns.is_some()),
            ("simple_returns", self.simple_returns.is_some()),
            ("prices", self.prices.is_some()),
            ("previous_prices", self.previous_prices.is_some()),
            ("executed_allocations", self.executed_allocations.is_some()),
        ]
    }

    /// Returns the field that gave the return of one of several assets, and its value.
    pub(in crate::service) fn given_of(&self, asset: &str) -> (String, Option<f64>) {
        let ways = [("simple_returns", &self.simple_returns), ("prices", &self.prices)];
        let given = ways.into_iter().find_map(|(field, values)| values.as_ref().map(|values| (field, values)));
        let (field, values) =
            given.map_or(("log_returns", self.log_returns.as_ref()), |(field, all)| (field, Some(all)));
        (format!("{field}.{asset}"), values.and_then(|values| values.get(asset).copied().flatten()))
    }
}
