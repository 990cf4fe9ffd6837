//! The orders that bring a user's own units to the advice of a session: whole lots, and no more cash than there is.
//!
//! With prices p_i, units u_i and cash k, wealth is `sum u_i p_i + k`. After the spending advised, asset i is worth its
//! advised share of the wealth that is left; the difference to what is held, in lots and rounded towards no trade, is an
//! order. Sales come first, less their cost. If the buys then cost more than the cash, all are reduced in proportion.
//!
//! Checked by: the tests below, and `tests/service/orders.rs`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::policy::advice::SpendingAdvice;
use crate::control::policy::advisor::AdviceMode;
use crate::control::request::by_name::{by_name, distinct, distinct_if_given};
use crate::control::request::rules::within;
use crate::service::advice::action::{AdviceKind, AdviceOptions};
use crate::service::callers::allowance::HeavyPermit;
use crate::service::entries::report::PRICE;
use crate::service::error::ServiceError;
use crate::service::sessions::Sessions;
use crate::store::Tenant;

/// The name of the risky asset of a session of one.
pub const ONE_ASSET: &str = "asset";
/// Allowed units and cash.
pub const AMOUNT: (f64, f64) = (0.0, 1e15);
/// Allowed sizes of a lot, in units.
pub const LOT: (f64, f64) = (1e-9, 1e9);
/// Allowed costs, as a share of what is traded.
pub const COST: (f64, f64) = (0.0, 0.1);
/// Part of a lot by which a trade may miss it through rounding.
const ROUNDING: f64 = 1e-9;

/// A question for the orders that follow a session's advice.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct OrdersQuestion {
    #[schema(example = "session_0123456789abcdef0123456789abcdef")]
    pub session: String,
    /// Price of a unit of each asset, by name, 1e-12 to 1e15; of a session of one asset its name is `asset`.
    #[serde(deserialize_with = "distinct")]
    pub prices: BTreeMap<String, f64>,
    /// Units held of each asset, by name, 0 to 1e15.
    #[serde(deserialize_with = "distinct")]
    pub units: BTreeMap<String, f64>,
    /// Money in the bank, 0 to 1e15.
    pub cash: f64,
    /// Units that can be traded at once, by name, 1e-9 to 1e9. Default: 1 of each asset.
    #[serde(default, deserialize_with = "distinct_if_given")]
    pub lots: Option<BTreeMap<String, f64>>,
    /// Smallest amount of money that is traded, 0 to 1e15. Default 0.
    #[serde(default)]
    pub smallest: f64,
    /// If true, nothing is sold. Default false.
    #[serde(default)]
    pub buys_only: bool,
    /// Cost of trading, as a share of the amount traded, 0 to 0.1. Default 0.
    #[serde(default)]
    pub trading_cost: f64,
}

/// Side of an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum OrderSide {
    /// Units are bought.
    Buy,
    /// Units are sold.
    Sell,
}

/// Why less is traded than was advised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum TradeLimit {
    /// The rest is less than a lot.
    Lot,
    /// The amount is below the smallest.
    Smallest,
    /// It would be a sale.
    BuysOnly,
    /// There is not enough cash.
    Cash,
}

/// An order.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct UnitOrder {
    pub asset: String,
    pub side: OrderSide,
    /// Units to trade, a whole number of lots.
    pub units: f64,
    /// Price of a unit, as it was sent.
    pub price: f64,
    /// Units times price.
    pub amount: f64,
}

/// A trade that was advised and is not, or not wholly, ordered.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TradeLeftOut {
    pub asset: String,
    /// Money that is not traded: to buy, or to sell if negative.
    pub amount: f64,
    /// The limit that took most of it.
    pub limit: TradeLimit,
}

/// The orders, and how things stand after them.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct OrdersAnswer {
    pub session: String,
    /// The period that the advice is for.
    pub period: usize,
    /// Worth of units and cash together, before spending.
    pub wealth: f64,
    /// Spending that is advised; it is taken from the cash.
    pub spending: f64,
    /// Sales first, each in the order of the assets.
    pub orders: Vec<UnitOrder>,
    /// Trades left out, in the order of the assets.
    pub left_out: Vec<TradeLeftOut>,
    /// Cash after spending, all orders and their cost; negative only if spending exceeds it and nothing could be sold.
    pub cash: f64,
    /// Cost of all orders.
    pub cost: f64,
    /// Share of each asset in what is left after them, by name.
    pub shares: BTreeMap<String, f64>,
    /// Share of each asset that is advised, by name.
    pub advised: BTreeMap<String, f64>,
}

/// One asset of a question.
struct OwnPosition {
    name: String,
    price: f64,
    units: f64,
    lot: f64,
    /// Share of the wealth after spending that is advised.
    share: f64,
}

impl OrdersQuestion {
    /// Reads the positions of the assets with these names and advised shares.
    fn positions(&self, names: &[String], shares: &[f64]) -> Result<Vec<OwnPosition>, FieldError> {
        let each = |field: &str, values: &BTreeMap<String, f64>, (low, high): (f64, f64)| {
            let values = by_name(field, "asset", values, names)?;
            let checked = |(name, value): (&String, &f64)| within(&format!("{field}.{name}"), *value, low, high);
            names.iter().zip(&values).try_for_each(checked).map(|()| values)
        };
        let (prices, units) = (each("prices", &self.prices, PRICE)?, each("units", &self.units, AMOUNT)?);
        let lots = self.lots.as_ref().map_or_else(|| Ok(vec![1.0; names.len()]), |lots| each("lots", lots, LOT))?;
        within("cash", self.cash, AMOUNT.0, AMOUNT.1)?;
        within("smallest", self.smallest, AMOUNT.0, AMOUNT.1)?;
        within("trading_cost", self.trading_cost, COST.0, COST.1)?;
        let position = |place: usize| OwnPosition {
            name: names[place].clone(),
            price: prices[place],
            units: units[place],
            lot: lots[place],
            share: shares[place],
        };
        let positions: Vec<OwnPosition> = (0..names.len()).map(position).collect();
        let worth: f64 = positions.iter().map(OwnPosition::worth).sum();
        if worth + self.cash <= 0.0 {
            return Err(FieldError::new("cash", self.cash, "must be above 0 if no units are held"));
        }
        Ok(positions)
    }

    /// Returns the orders for the advised shares, of the wealth that is left after the share `spent`.
    fn answer(&self, period: usize, names: &[String], shares: &[f64], spent: f64) -> Result<OrdersAnswer, FieldError> {
        let positions = self.positions(names, shares)?;
        let wealth = positions.iter().map(OwnPosition::worth).sum::<f64>() + self.cash;
        let spending = spent * wealth;
        let wanted: Vec<f64> =
            positions.iter().map(|position| position.share * (wealth - spending) - position.worth()).collect();
        let mut traded: Vec<f64> =
            positions.iter().zip(&wanted).map(|(own, amount)| self.allowed(own, *amount)).collect();
        let amounts = |traded: &[f64]| -> Vec<f64> {
            positions.iter().zip(traded).map(|(own, units)| units * own.price).collect()
        };
        let sum = |amounts: &[f64], sign: f64| amounts.iter().map(|amount| (sign * amount).max(0.0)).sum::<f64>();
        let (sold, bought) = (sum(&amounts(&traded), -1.0), sum(&amounts(&traded), 1.0));
        let free = (self.cash - spending + sold * (1.0 - self.trading_cost)).max(0.0);
        let is_short = bought * (1.0 + self.trading_cost) > free;
        if is_short {
            let part = free / (bought * (1.0 + self.trading_cost));
            for (own, units) in positions.iter().zip(&mut traded).filter(|(_, units)| **units > 0.0) {
                *units = self.allowed(own, part * *units * own.price);
            }
        }
        let amounts = amounts(&traded);
        let cost = self.trading_cost * amounts.iter().map(|amount| amount.abs()).sum::<f64>();
        let cash = self.cash - spending - amounts.iter().sum::<f64>() - cost;
        let left_out = positions.iter().zip(wanted.iter().zip(&amounts)).filter_map(|(own, (wanted, amount))| {
            let rest = wanted - amount;
            let limit = match () {
                () if *wanted < 0.0 && self.buys_only => TradeLimit::BuysOnly,
                () if *wanted > 0.0 && is_short && rest > own.lot * own.price => TradeLimit::Cash,
                () if *amount == 0.0 && wanted.abs() < self.smallest => TradeLimit::Smallest,
                () => TradeLimit::Lot,
            };
            (rest.abs() > ROUNDING * own.lot * own.price).then(|| TradeLeftOut {
                asset: own.name.clone(),
                amount: rest,
                limit,
            })
        });
        let order = |own: &OwnPosition, units: f64, side: OrderSide| UnitOrder {
            asset: own.name.clone(),
            side,
            units: units.abs(),
            price: own.price,
            amount: units.abs() * own.price,
        };
        let of = |side: OrderSide, sign: f64| {
            let chosen = positions.iter().zip(&traded).filter(move |(_, units)| sign * **units > 0.0);
            chosen.map(move |(own, units)| order(own, *units, side)).collect::<Vec<UnitOrder>>()
        };
        let after: Vec<f64> = positions.iter().zip(&amounts).map(|(own, amount)| own.worth() + amount).collect();
        let whole = after.iter().sum::<f64>() + cash;
        let named = |values: Vec<f64>| names.iter().cloned().zip(values).collect::<BTreeMap<String, f64>>();
        Ok(OrdersAnswer {
            session: self.session.clone(),
            period,
            wealth,
            spending,
            orders: [of(OrderSide::Sell, -1.0), of(OrderSide::Buy, 1.0)].concat(),
            left_out: left_out.collect(),
            cash,
            cost,
            shares: named(after.iter().map(|worth| if whole > 0.0 { worth / whole } else { 0.0 }).collect()),
            advised: named(shares.to_vec()),
        })
    }

    /// Returns the units of a wanted amount that may be traded: whole lots towards no trade, or none.
    fn allowed(&self, own: &OwnPosition, amount: f64) -> f64 {
        if self.buys_only && amount < 0.0 {
            return 0.0;
        }
        let lots = amount / own.price / own.lot;
        let units = own.lot * (lots.abs() * (1.0 + ROUNDING)).floor().copysign(lots);
        // No more is sold than there is.
        let units = units.max(-own.lot * (own.units / own.lot * (1.0 + ROUNDING)).floor());
        if (units * own.price).abs() < self.smallest { 0.0 } else { units }
    }
}

impl OwnPosition {
    /// Returns the worth of the units held.
    fn worth(&self) -> f64 {
        self.units * self.price
    }
}

impl Sessions {
    /// Returns the orders that bring units and cash to the advice of a session for its coming period.
    ///
    /// # Errors
    /// There is no such session, it has reached its horizon, its problem has no assets, or a field breaks a rule.
    pub async fn orders(
        &self,
        tenant: &Tenant,
        question: OrdersQuestion,
        turn: &HeavyPermit,
    ) -> Result<OrdersAnswer, ServiceError> {
        let options = AdviceOptions { mode: AdviceMode::Surrogate, explain: false, sensitivity: false };
        let found = self.action(tenant, &question.session, options, turn).await?.value;
        let AdviceKind::Account(account) = found.kind else {
            let rule = "must be one of an investor: a declared problem has actions and no assets";
            return Err(FieldError::new("session", &question.session, rule).into());
        };
        let spent = SpendingAdvice::share_of(account.advice.spending);
        let (names, shares) = match &account.assets {
            None => (vec![ONE_ASSET.to_owned()], vec![account.advice.allocation]),
            Some(assets) => (assets.names.to_vec(), assets.shares(account.advice.allocation)),
        };
        Ok(question.answer(found.period, &names, &shares, spent)?)
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::numerics::machine::streams::stream;

    fn question(prices: &[f64], units: &[f64], cash: f64) -> (OrdersQuestion, Vec<String>) {
        let names: Vec<String> = (0..prices.len()).map(|place| format!("a{place}")).collect();
        let named = |values: &[f64]| names.iter().cloned().zip(values.iter().copied()).collect();
        let question = OrdersQuestion {
            session: "session_1".into(),
            prices: named(prices),
            units: named(units),
            cash,
            lots: None,
            smallest: 0.0,
            buys_only: false,
            trading_cost: 0.0,
        };
        (question, names)
    }

    /// 30 units at 10 and 3 at 200 and 100 in cash are 1000. Half and a fifth of it: 20 more at 10, and 2 of 3 sold.
    #[test]
    fn orders_agree_with_pencil_and_paper() {
        let (question, names) = question(&[10.0, 200.0], &[30.0, 3.0], 100.0);
        let found = question.answer(4, &names, &[0.5, 0.2], 0.0).unwrap();
        assert_eq!((found.wealth, found.cash, found.cost, found.period), (1000.0, 300.0, 0.0, 4));
        let sell = UnitOrder { asset: "a1".into(), side: OrderSide::Sell, units: 2.0, price: 200.0, amount: 400.0 };
        let buy = UnitOrder { asset: "a0".into(), side: OrderSide::Buy, units: 20.0, price: 10.0, amount: 200.0 };
        assert_eq!((&found.orders, &found.left_out), (&vec![sell, buy.clone()], &vec![]));
        assert_eq!(found.shares, found.advised);
        // With buys alone the 100 in cash pay for ten.
        let only = OrdersQuestion { buys_only: true, ..question.clone() };
        let found = only.answer(4, &names, &[0.5, 0.2], 0.0).unwrap();
        assert_eq!((found.orders[0].units, found.orders.len(), found.cash), (10.0, 1, 0.0));
        let limits: Vec<TradeLimit> = found.left_out.iter().map(|left| left.limit).collect();
        assert_eq!(limits, [TradeLimit::Cash, TradeLimit::BuysOnly]);
        // A smallest amount, and spending of a tenth: 900 are left, half of it is 15 more.
        let coarse = OrdersQuestion { smallest: 300.0, ..question };
        let found = coarse.answer(4, &names, &[0.5, 0.2], 0.1).unwrap();
        assert_eq!((found.spending, found.orders.len(), found.orders[0].asset.as_str()), (100.0, 1, "a1"));
        assert_eq!(found.left_out[0], TradeLeftOut { asset: "a0".into(), amount: 150.0, limit: TradeLimit::Smallest });
        assert_eq!(buy.side, OrderSide::Buy);
    }

    /// Over random positions: lots are whole, nothing is sold that is not held, no cash is spent that is not there, money is
    /// neither made nor lost, and without limits every asset is within a lot of its advised share.
    #[test]
    fn no_order_breaks_a_limit() {
        for case in 0..2000 {
            let mut random = stream(3, "orders", case, 0);
            let count = random.random_range(1..8);
            let mut draw =
                |low: f64, high: f64| -> Vec<f64> { (0..count).map(|_| random.random_range(low..high)).collect() };
            let (prices, held, weights) = (draw(0.01, 500.0), draw(0.0, 100.0), draw(0.0, 1.0));
            let units: Vec<f64> = held.iter().map(|units| units.floor()).collect();
            let total: f64 = weights.iter().sum::<f64>().max(1.0);
            let shares: Vec<f64> = weights.iter().map(|weight| weight / total).collect();
            let (mut question, names) = question(&prices, &units, random.random_range(1.0..20_000.0));
            question.trading_cost = if case % 2 == 0 { 0.0 } else { random.random_range(0.0..0.1) };
            question.buys_only = case % 5 == 0;
            question.smallest = if case % 3 == 0 { random.random_range(0.0..500.0) } else { 0.0 };
            let spent = if case % 4 == 0 { random.random_range(0.0..0.05) } else { 0.0 };
            let found = question.answer(1, &names, &shares, spent).unwrap();
            let worth: f64 = prices.iter().zip(&units).map(|(price, units)| price * units).sum();
            let mut after = units.clone();
            for order in &found.orders {
                let place = names.iter().position(|name| *name == order.asset).unwrap();
                assert!(order.units.fract() == 0.0 && order.units > 0.0 && order.amount >= question.smallest * 0.999);
                after[place] += if order.side == OrderSide::Buy { order.units } else { -order.units };
                assert!(after[place] >= 0.0 && !(question.buys_only && order.side == OrderSide::Sell), "{order:?}");
            }
            let kept: f64 = prices.iter().zip(&after).map(|(price, units)| price * units).sum();
            let lost = worth + question.cash - kept - found.cash - found.spending - found.cost;
            assert!(lost.abs() < 1e-9 * (worth + question.cash), "{lost}");
            // Spending may exceed the cash if nothing may be sold, or only whole lots.
            assert!(found.cash >= -1e-9 * worth || found.spending > question.cash, "{found:?}");
            let is_free =
                question.trading_cost == 0.0 && !question.buys_only && question.smallest == 0.0 && spent == 0.0;
            for (place, name) in names.iter().enumerate().filter(|_| is_free) {
                let off = found.shares[name] * found.wealth - shares[place] * found.wealth;
                let lots: f64 = prices.iter().sum();
                assert!(off.abs() <= lots * 1.000_001, "{name}: {off} {found:?}");
            }
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let (good, names) = question(&[10.0, 200.0], &[0.0, 0.0], 100.0);
        let refused = |change: &dyn Fn(&mut OrdersQuestion)| {
            let mut wrong = good.clone();
            change(&mut wrong);
            wrong.answer(1, &names, &[0.5, 0.2], 0.0).unwrap_err().field
        };
        assert_eq!(refused(&|own| own.cash = 0.0), "cash");
        assert_eq!(refused(&|own| own.cash = f64::NAN), "cash");
        assert_eq!(refused(&|own| own.trading_cost = 0.2), "trading_cost");
        assert_eq!(refused(&|own| own.smallest = -1.0), "smallest");
        assert_eq!(refused(&|own| own.prices.insert("a1".into(), 0.0).map_or((), drop)), "prices.a1");
        assert_eq!(refused(&|own| own.units.remove("a0").map_or((), drop)), "units.a0");
        assert_eq!(refused(&|own| own.prices.insert("gold".into(), 1.0).map_or((), drop)), "prices.gold");
        assert_eq!(
            refused(&|own| own.lots = Some(BTreeMap::from([("a0".into(), 0.0), ("a1".into(), 1.0)]))),
            "lots.a0"
        );
    }
}
