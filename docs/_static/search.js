/* SPDX-License-Identifier: Apache-2.0
 * How the search of the site ranks: pages that explain before lists, and words in titles first. */
const PAGES = [
  [/^(start|(how-to|tutorials|concepts)\/(?!index$))/, 4],
  [/^(generated\/gallery\/.*plot|reference\/(node|ros|scene))/, 2],
  [/^(architecture|project|reference\/(commands|python)|.*index$)/, -6],
];
var Scorer = {
  objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
  score: ([page, title, , , score]) => {
    const query = new URLSearchParams(window.location.search).get("q") || "";
    const words = query.toLowerCase().match(/[\p{L}\d_]{2,}/gu) || [""];
    const inTitle = words.filter((word) => title.toLowerCase().includes(word)).length;
    const [, rank] = PAGES.find(([pattern]) => pattern.test(page)) || [, 0];
    return score + rank + (10 * inTitle) / words.length;
  },
};
