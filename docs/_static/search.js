/* SPDX-License-Identifier: Apache-2.0
 * How the search of the site ranks: pages that explain before lists, and words in titles first.
 * Where only lists have all words, it shows pages with any, those with many and rare words first. */
const PAGES = [
  [/^(start|(how-to|tutorials|concepts)\/(?!index$))/, 4],
  [/^(generated\/gallery\/.*plot|laboratory|reference\/(node|ros|scene))/, 2],
  [/^(architecture|project|reference\/(commands|messages|python)|.*index$)/, -6],
];
const rank = (page) => (PAGES.find(([pattern]) => pattern.test(page)) || [, 0])[1];
var Scorer = {
  objNameMatch: 9, objPartialMatch: 0, objPrio: { 0: 15, 1: 3, 2: -5 }, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
  score: ([page, title, , , score]) => {
    const query = new URLSearchParams(window.location.search).get("q") || "";
    const words = query.toLowerCase().match(/[\p{L}\d_]{2,}/gu) || [""];
    const inTitle = words.filter((word) => title.toLowerCase().includes(word)).length;
    return score + rank(page) + (10 * inTitle) / words.length;
  },
};

const withAll = Search.performTermsSearch; // Sphinx's own file is read before this one
Search.performTermsSearch = (words, excluded) => {
  const found = withAll(words, excluded);
  if (words.size < 2 || found.some(([page]) => rank(page) >= 0)) return found;
  const [pages, count] = [new Map(), Search._index.docnames.length];
  for (const word of words) {
    const some = withAll(new Set([word]), excluded);
    for (const [page, title, anchor, about, score, ...rest] of some) {
      const before = pages.has(page) ? pages.get(page)[4] : 0;
      const sum = before + score * Math.log(count / some.length);
      pages.set(page, [page, title, anchor, about, sum, ...rest]);
    }
  }
  return [...pages.values()];
};
