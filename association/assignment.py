"""Minimum-cost assignment on a sparse list of admissible pairs.

Rows and columns that no pair connects cannot influence each other, so the problem is solved one
connected component at a time: on a highway most components are one track and one detection.
"""

from __future__ import annotations

import heapq

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray

# Cells of a matrix that is faster filled and searched than lists are.
_MOST_DENSE = 4096


@njit(cache=True)
def assign(
    num_rows: int,
    num_cols: int,
    rows: IntArray,
    cols: IntArray,
    costs: FloatArray,
    unassigned_cost: float,
) -> IntArray:
    """Assign columns to rows so that the total cost is least; each row and column is used at most once.

    A row may stay without a column at `unassigned_cost`, so a pair is taken only where that lowers the total:
    with a value that no cost is below, none is. With a value greater than any sum of costs, as many pairs as
    possible are taken (what an assignment on a matrix with infinite entries does).

    Args:
        num_rows: number of rows.
        num_cols: number of columns.
        rows: (P,) row of each admissible pair.
        cols: (P,) column of each admissible pair; a pair is listed at most once.
        costs: (P,) finite cost of each pair.
        unassigned_cost: cost of a row without column.

    Returns:
        (num_rows,) the column of each row, or -1.
    """
    match = np.full(num_rows, -1, dtype=np.int64)
    num_pairs = len(rows)
    if num_pairs == 0:
        return match
    order, starts = _components(num_rows, num_cols, rows, cols)
    row_slot = np.full(num_rows, -1, dtype=np.int64)
    col_slot = np.full(num_cols, -1, dtype=np.int64)
    for c in range(len(starts) - 1):
        pairs = order[starts[c] : starts[c + 1]]
        if len(pairs) == 1:
            p = pairs[0]
            if costs[p] < unassigned_cost:
                match[rows[p]] = cols[p]
            continue
        num_r = 0
        num_c = 0
        row_of = np.empty(len(pairs), dtype=np.int64)
        col_of = np.empty(len(pairs), dtype=np.int64)
        for p in pairs:
            if row_slot[rows[p]] < 0:
                row_slot[rows[p]] = num_r
                row_of[num_r] = rows[p]
                num_r += 1
            if col_slot[cols[p]] < 0:
                col_slot[cols[p]] = num_c
                col_of[num_c] = cols[p]
                num_c += 1
        if num_r * num_c > _MOST_DENSE:
            at, to, given = row_slot[rows[pairs]], col_slot[cols[pairs]], costs[pairs]
            solution = solve_sparse(num_r, num_c, at, to, given, unassigned_cost)
        else:
            block = np.full((num_r, num_c), np.inf)
            for p in pairs:
                block[row_slot[rows[p]], col_slot[cols[p]]] = costs[p]
            solution = solve_dense(block, unassigned_cost)
        for r in range(num_r):
            if solution[r] >= 0:
                match[row_of[r]] = col_of[solution[r]]
    return match


@njit(cache=True)
def solve_dense(cost: FloatArray, unassigned_cost: float) -> IntArray:
    """Solve one dense assignment problem by shortest augmenting paths with potentials.

    The algorithm is that of Jonker and Volgenant (1987) in the form without initial reductions; each row has
    a private column of cost `unassigned_cost` beside the real ones.

    Args:
        cost: (R, C) costs; +inf where a pair is not admissible.
        unassigned_cost: finite cost of leaving a row without column.

    Returns:
        (R,) column of each row, or -1.
    """
    num_r, num_c = cost.shape
    u = np.zeros(num_r)
    v = np.zeros(num_c)
    col_of = np.full(num_r, -1, dtype=np.int64)
    row_of = np.full(num_c, -1, dtype=np.int64)
    distance = np.empty(num_c)
    parent = np.empty(num_c, dtype=np.int64)
    done = np.empty(num_c, dtype=np.bool_)
    for start in range(num_r):
        distance[:] = np.inf
        done[:] = False
        parent[:] = -1
        row = start
        reached = 0.0
        # The cheapest end of the path so far that leaves some row on the way without column.
        exit_cost = np.inf
        exit_row = -1
        sink = -1
        while True:
            leave = reached + unassigned_cost - u[row]
            if leave < exit_cost:
                exit_cost = leave
                exit_row = row
            best = np.inf
            best_col = -1
            for c in range(num_c):
                if done[c]:
                    continue
                d = reached + cost[row, c] - u[row] - v[c]
                if d < distance[c]:
                    distance[c] = d
                    parent[c] = row
                if distance[c] < best:
                    best = distance[c]
                    best_col = c
            if best_col < 0 or exit_cost <= best:
                reached = exit_cost
                break
            reached = best
            done[best_col] = True
            if row_of[best_col] < 0:
                sink = best_col
                break
            row = row_of[best_col]
        # Potentials stay feasible and tight on the matching (complementary slackness).
        u[start] += reached
        for c in range(num_c):
            if done[c] and row_of[c] >= 0:
                u[row_of[c]] += reached - distance[c]
            if done[c]:
                v[c] -= reached - distance[c]
        if sink < 0:
            freed = col_of[exit_row]
            if exit_row == start:
                continue
            col_of[exit_row] = -1
            sink = freed
        while True:
            r = parent[sink]
            row_of[sink] = r
            previous = col_of[r]
            col_of[r] = sink
            if r == start:
                break
            sink = previous
    return col_of


@njit(cache=True)
def solve_sparse(
    num_rows: int, num_cols: int, rows: IntArray, cols: IntArray, costs: FloatArray, unassigned_cost: float
) -> IntArray:
    """Solve one assignment problem as `solve_dense` does, to the same bit, by its admissible pairs alone.

    In a crowd everything hangs together, and a matrix of all rows and columns would take gigabytes. The
    columns that a path can reach wait in a heap, the nearest first and of equally near ones the first.

    Args:
        num_rows: number of rows R.
        num_cols: number of columns.
        rows: (P,) row of each admissible pair.
        cols: (P,) column of each; a pair is listed at most once.
        costs: (P,) finite cost of each.
        unassigned_cost: finite cost of leaving a row without column.

    Returns:
        (R,) column of each row, or -1.
    """
    order = np.argsort(rows, kind="mergesort")
    begin = np.searchsorted(rows[order], np.arange(num_rows + 1))
    u, v = np.zeros(num_rows), np.zeros(num_cols)
    col_of, row_of = np.full(num_rows, -1, dtype=np.int64), np.full(num_cols, -1, dtype=np.int64)
    distance, parent = np.full(num_cols, np.inf), np.full(num_cols, -1, dtype=np.int64)
    done = np.zeros(num_cols, dtype=np.bool_)
    for start in range(num_rows):
        near = [(np.inf, np.int64(num_cols))]
        seen = [np.int64(num_cols)][:0]
        row, reached, exit_cost, exit_row, sink = start, 0.0, np.inf, -1, -1
        while True:
            leave = reached + unassigned_cost - u[row]
            if leave < exit_cost:
                exit_cost, exit_row = leave, row
            for p in order[begin[row] : begin[row + 1]]:
                c = cols[p]
                d = reached + costs[p] - u[row] - v[c]
                if not done[c] and d < distance[c]:
                    if parent[c] < 0:
                        seen.append(c)
                    distance[c], parent[c] = d, row
                    heapq.heappush(near, (d, c))
            while near[0][1] < num_cols and (done[near[0][1]] or near[0][0] > distance[near[0][1]]):
                heapq.heappop(near)
            best, best_col = near[0]
            if best_col == num_cols or exit_cost <= best:
                reached = exit_cost
                break
            reached = best
            done[best_col] = True
            if row_of[best_col] < 0:
                sink = int(best_col)
                break
            row = int(row_of[best_col])
        u[start] += reached
        for c in seen:
            if done[c] and row_of[c] >= 0:
                u[row_of[c]] += reached - distance[c]
            if done[c]:
                v[c] -= reached - distance[c]
        if sink < 0 and exit_row != start:
            sink = col_of[exit_row]
            col_of[exit_row] = -1
        while sink >= 0:
            r = parent[sink]
            row_of[sink] = r
            previous = col_of[r]
            col_of[r] = sink
            sink = -1 if r == start else previous
        for c in seen:
            distance[c], parent[c], done[c] = np.inf, -1, False
    return col_of


@njit(cache=True)
def _components(num_rows: int, num_cols: int, rows: IntArray, cols: IntArray) -> tuple[IntArray, IntArray]:
    """Group the pairs by connected component: their order (P,) and where each group starts (G + 1,)."""
    parent = np.arange(num_rows + num_cols)
    for p in range(len(rows)):
        a = _root(parent, rows[p])
        b = _root(parent, num_rows + cols[p])
        if a != b:
            parent[max(a, b)] = min(a, b)
    label = np.full(num_rows + num_cols, -1, dtype=np.int64)
    group = np.empty(len(rows), dtype=np.int64)
    count = 0
    for p in range(len(rows)):
        root = _root(parent, rows[p])
        if label[root] < 0:
            label[root] = count
            count += 1
        group[p] = label[root]
    starts = np.zeros(count + 1, dtype=np.int64)
    for p in range(len(rows)):
        starts[group[p] + 1] += 1
    starts = np.cumsum(starts)
    cursor = starts[:-1].copy()
    order = np.empty(len(rows), dtype=np.int64)
    for p in range(len(rows)):
        order[cursor[group[p]]] = p
        cursor[group[p]] += 1
    return order, starts


@njit(cache=True)
def _root(parent: npt.NDArray[np.int64], node: int) -> int:
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node
