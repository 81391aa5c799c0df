"""The exchange folder and plain formats, written and read."""

from draglag.exchange.csv_files import write_csv
from draglag.exchange.folder import read_exchange, session_folder, write_exchange
from draglag.exchange.left_out import left_out
from draglag.exchange.matlab import write_mat
from draglag.exchange.netcdf import write_netcdf

__all__ = ["left_out", "read_exchange", "session_folder", "write_csv", "write_exchange", "write_mat", "write_netcdf"]
